"""Names of keys that pictures leave open, decided by the sound of the same music."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from pianomime.music import Score
from pianomime.video.notes.fusion import Fused, fuse

_BETTER = 0.02
"""Share of the notes that are seen by which more must be heard for a less likely naming."""


class Named(NamedTuple):
    """The naming of the keys in which most notes are both seen and heard.

    Attributes:
        way: its number.
        fused: the notes that are seen so, with what the sound says about them.
        decided: whether the sound tells it from all others.
    """

    way: int
    fused: Fused
    decided: bool


def name_by_sound(ways: Sequence[Score], heard: Score, late: float | None = None) -> Named:
    """Find the naming of the keys that the sound speaks for.

    Args:
        ways: the notes that are seen, in each way to name the keys, the likeliest first.
        heard: notes of the sound, in its own time.
        late: how much later the sound is than the pictures [s], if that is known.

    Returns:
        Of those that the sound does not tell apart the likeliest.
    """
    every = [fuse(seen, heard, late) for seen in ways]
    most = max(fused.both for fused in every)
    near = [way for way, fused in enumerate(every) if fused.both >= most - _BETTER * len(ways[0])]
    return Named(near[0], every[near[0]], len(near) == 1)
