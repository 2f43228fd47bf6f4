"""Fusion of the notes that are seen as light with those that are heard: each says what it knows.

Light shows which keys are played. The sound says when exactly, how loud, and what the pedal does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS
from pianomime.music import Score
from pianomime.music.matching import Candidates
from pianomime.short_repr import short_repr
from pianomime.video.notes.offset import LATEST_SOUND

_TOGETHER = 0.1
"""[s] A light and a sound that are further apart are two notes; two frames are lost to the rate of
pictures, and to light that takes its time."""
_ALIKE = 0.5
"""Share of the notes that are seen of which at least so many are heard, if both are one music."""


@dataclass(frozen=True, eq=False)
class Fused:
    """Notes that are seen, with what the sound says about them.

    Attributes:
        score: the notes that are seen, in the time of the pictures, with the pedal that is heard.
        late: how much later the sound is than the pictures [s].
        both: number of notes that are seen and heard.
        only_seen: number of notes that are not heard; they have a usual velocity.
        only_heard: number of notes that are not seen, and left out.
    """

    score: Score
    late: float
    both: int
    only_seen: int
    only_heard: int

    __repr__ = short_repr

    @property
    def alike(self) -> bool:
        """Whether the sound is of the notes that are seen."""
        return self.both >= _ALIKE * (self.both + self.only_seen)


def fuse(seen: Score, heard: Score, late: float | None = None) -> Fused:
    """Give the notes that are seen the velocities, the times and the pedal of those that are heard.

    Args:
        seen: notes of keys that light up, in the time of the pictures.
        heard: notes of the sound, in its own time.
        late: how much later the sound is than the pictures [s]; by default that at which most
            notes are both seen and heard.
    """
    if late is None:
        late = _lateness(seen, heard)
    # A note that begins before the pictures do would have no time.
    begins = heard.onset >= late
    times = heard.onset[begins] - late
    sounding = Score(
        heard.key[begins],
        times,
        np.maximum(heard.offset[begins] - late, times),
        heard.velocity[begins],
        np.maximum(heard.pedal[heard.pedal[:, 1] > late] - late, 0.0),
    )
    pairs = Candidates.of(seen, sounding, _TOGETHER).nearest()
    onset, velocity = seen.onset.copy(), seen.velocity.copy()
    onset[pairs.wanted] = sounding.onset[pairs.played]
    velocity[pairs.wanted] = sounding.velocity[pairs.played]
    if len(pairs.wanted):
        alone = np.setdiff1d(np.arange(len(seen)), pairs.wanted)
        velocity[alone] = round(float(np.median(sounding.velocity[pairs.played])))
    offset = _until_the_next(seen.key, onset, np.maximum(seen.offset, onset + FRAME_SECONDS))
    score = replace(seen, onset=onset, offset=offset, velocity=velocity, pedal=sounding.pedal)
    both = len(pairs.wanted)
    return Fused(score, late, both, len(seen) - both, len(heard) - both)


def _lateness(seen: Score, heard: Score) -> float:
    """How much later the sound is than the pictures [s]: where most notes are seen and heard.

    Of several such times the nearest to none at all. 0 without a note that is both.
    """
    late = np.sort(Candidates.of(seen, heard, LATEST_SOUND).late)
    if not len(late):
        return 0.0
    # Of each stretch of time in which pairs lie together, from its first pair on.
    stop = np.searchsorted(late, late + _TOGETHER, side="right")
    count = stop - np.arange(len(late))
    first = np.arange(len(late))
    # Each is sorted, so its median is in its middle.
    middle = (late[(first + stop - 1) // 2] + late[(first + stop) // 2]) / 2
    return float(middle[np.lexsort((np.abs(middle), -count))[0]])


def _until_the_next(
    key: NDArray[np.int64], onset: NDArray[np.float64], offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) Offsets that are no later than the next onset on the same key."""
    order = np.lexsort((onset, key))
    ended = offset[order]
    same = key[order][1:] == key[order][:-1]
    ended[:-1][same] = np.minimum(ended[:-1], onset[order][1:])[same]
    result = np.empty_like(offset)
    result[order] = ended
    return result
