"""Loudness of a recording, and what it says of the notes that were heard in it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pianomime.music.score import Score

PARTS = 10
"""Parts of a second whose loudness is measured."""

_QUIET = 1e-3
"""Loudness, root mean square of samples -1..1, below which nothing is heard: -60 dB."""
_STRUCK = 3
"""Parts from the onset on of which one must be heard."""
_LOUD = 0.1
"""Share of the loudness of loud parts from which a part is loud, too."""
_LOUD_PERCENTILE = 95
_HELD = 10
"""Parts without an onset, after one, in which it shows whether notes fade: a second."""
_FEWEST_HELD = 3
"""Least number of such times to judge by."""
_RINGS = 1.0
"""[s] for which a note is heard after its key and the pedal are up."""


def loudness_of(samples: NDArray[np.float32], rate: int) -> NDArray[np.float32]:
    """Root mean square of every tenth of a second.

    Args:
        samples: (S,) about -1..1.
        rate: samples per second [Hz], a multiple of `PARTS`.

    Returns:
        (ceil(S PARTS / rate),) float32.
    """
    size = rate // PARTS
    padded = np.pad(samples, (0, -len(samples) % size)).reshape(-1, size)
    return np.asarray(np.sqrt(np.mean(np.square(padded, dtype=np.float64), axis=1)), np.float32)


class Loudness:
    """How loud a whole recording is, in parts of a tenth of a second."""

    def __init__(self, parts: Iterable[NDArray[np.float32]]) -> None:
        """Put together what was measured.

        Args:
            parts: as `loudness_of` returns them, one after the other.
        """
        self._parts = np.concatenate([np.empty(0, np.float32), *parts])

    @property
    def seconds(self) -> float:
        """Length of the recording, to a tenth of a second [s]."""
        return len(self._parts) / PARTS

    @property
    def silent(self) -> bool:
        """Whether nothing is heard at all."""
        return not (self._parts > _QUIET).any()

    def struck(self, onset: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) bool: whether anything is heard when notes begin.

        Args:
            onset: (N,) [s].
        """
        first = np.floor(onset * PARTS).astype(np.int64)
        padded = np.append(self._parts, np.zeros(_STRUCK, np.float32))
        at = np.minimum(first[:, None] + np.arange(_STRUCK), len(padded) - 1)
        return np.asarray((padded[at] > _QUIET).any(axis=1))

    def unexplained(self, score: Score) -> float:
        """Share of the loud time in which no note sounds: of voices, other instruments, noise.

        Args:
            score: the notes that were heard.
        """
        loud = self._parts > _LOUD * np.percentile(self._parts, _LOUD_PERCENTILE)
        if not loud.any():
            return 0.0
        down = np.zeros(len(self._parts) + 1, np.int64)
        spans = np.column_stack((score.onset, score.offset))
        spans = np.concatenate((spans, score.pedal)) + np.array([0.0, _RINGS])
        for edge, step in ((np.floor(spans[:, 0] * PARTS), 1), (np.ceil(spans[:, 1] * PARTS), -1)):
            np.add.at(down, np.clip(edge, 0, len(self._parts)).astype(np.int64), step)
        sounding = np.cumsum(down)[:-1] > 0
        return float(1 - sounding[loud].mean())

    def steadiness(self, score: Score) -> float:
        """How loud held notes are after a second, as a share of their loudness at first.

        The strings of a piano fade; wind, bows and organs go on.

        Args:
            score: the notes that were heard.

        Returns:
            The median over notes that sound on for a second in which no other begins; 0 if there
            are too few of them.
        """
        first = np.floor(score.onset * PARTS).astype(np.int64) + 1
        following = np.append(score.onset[1:], np.inf)
        held = np.minimum(following, score.offset) - score.onset >= (_HELD + 2) / PARTS
        held &= first + _HELD < len(self._parts)
        if held.sum() < _FEWEST_HELD:
            return 0.0
        begun, later = self._parts[first[held]], self._parts[first[held] + _HELD]
        return float(np.median(later / np.maximum(begun, _QUIET)))
