"""Time in which keys are down: what one piano can sound of a score, and what two share of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pianomime.music.score import MAX_SECONDS, Score


def strikes(score: Score) -> Score:
    """The score as one piano can sound it: on each key, a note ends where the next begins.

    That next one lasts until both have ended, as in `Score.note_frames`: the key stays down for
    as long as any voice holds it.

    Args:
        score: any score.
    """
    offset = score.offset.copy()
    order = np.lexsort((score.onset, score.key))
    for here, after in zip(order[:-1].tolist(), order[1:].tolist(), strict=True):
        if score.key[here] == score.key[after] and offset[here] > score.onset[after]:
            offset[after] = max(offset[after], offset[here])
            offset[here] = score.onset[after]
    return replace(score, offset=offset)


def key_seconds(score: Score) -> NDArray[np.float64]:
    """(I, 2) Times in which a key is down, of all keys on one line of time, in order and apart [s].

    Args:
        score: any score; it is heard as `strikes` has it.
    """
    struck = strikes(score)
    order = np.lexsort((struck.onset, struck.key))
    at = struck.key[order] * (MAX_SECONDS + 1)
    return np.stack([at + struck.onset[order], at + struck.offset[order]], axis=1)


def overlap(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Length of what two lists of intervals have in common [s].

    Args:
        one: (I, 2), in order and apart [s].
        other: (J, 2), likewise.
    """

    def covered(intervals: NDArray[np.float64], until: NDArray[np.float64]) -> NDArray[np.float64]:
        """Length of what lies before each time."""
        if not len(intervals):
            return np.zeros_like(until)
        sums = np.concatenate(([0.0], np.cumsum(intervals[:, 1] - intervals[:, 0])))
        index = np.searchsorted(intervals[:, 0], until, side="right")
        last = intervals[np.maximum(index - 1, 0), 1]
        return np.asarray(sums[index] - np.where(index > 0, np.maximum(last - until, 0.0), 0.0))

    return float((covered(one, other[:, 1]) - covered(one, other[:, 0])).sum())
