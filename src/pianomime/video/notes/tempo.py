"""Tempo of notes against that of the fingers: slow motion whose sound has its usual speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score
from pianomime.video.notes.agreement import fingers_about

_RATIOS = 0.8 * 1.01 ** np.arange(47)
"""Speeds that are tried, 0.8 to 1.26; beyond, nobody takes one for the other."""
_COMPARED = 60.0
"""[s] Notes that are compared, from the first one on: half a step of the speeds, and half of this
time, is as long as fingers are over their keys before and after."""
_FURTHEST = 25.0
"""[s] Most by which notes are placed elsewhere at any speed: none is better for that alone."""
_BETTER = 0.1
"""Share of notes by which another speed must fit better to be told."""
_FEWEST = 25
"""Notes that are needed: few of them have a finger on their key at some speed or other."""


class Tempo(NamedTuple):
    """A tempo at which clearly more notes have a finger on their key.

    Attributes:
        ratio: duration of what is played in the video, divided by that of the notes.
        touched: share of the notes with a finger on their key, if they are as slow.
        now: the same share, at the tempo that they have; wherever they are placed, too.
    """

    ratio: float
    touched: float
    now: float


def better_tempo(score: Score, points: NDArray[np.floating]) -> Tempo | None:
    """The tempo with which clearly more notes have a finger on their key; None if there is none.

    Args:
        score: the notes, in the time of the video.
        points: (T, H, 6, 2) world x, y of the hands [m], infinite where a hand was not seen.
    """
    first = float(score.onset[0])
    compared = score.onset < first + _COMPARED
    if compared.sum() < _FEWEST:
        return None
    key, since = score.key[compared], score.onset[compared] - first
    begin = max(0, round((first - _FURTHEST) * FRAME_RATE))
    end = round((first + _RATIOS[-1] * _COMPARED + _FURTHEST) * FRAME_RATE)
    near = fingers_about(points[begin:end])
    keys = np.unique(key)
    row, near = np.searchsorted(keys, key), near[keys].astype(np.float32)

    def best(ratio: float) -> float:
        """Greatest share of the notes with a finger on their key, wherever they are placed."""
        frame = np.rint((first + ratio * since) * FRAME_RATE).astype(np.int64) - begin
        struck = np.zeros((len(keys), frame.max() + 1), np.float32)
        np.add.at(struck, (row, frame), 1.0)
        count = fftconvolve(near, struck[:, ::-1], axes=1).sum(axis=0)
        lag = np.arange(len(count)) - frame.max()
        return float(count[np.abs(lag) <= _FURTHEST * FRAME_RATE].max() / len(key))

    shares = np.array([best(ratio) for ratio in _RATIOS])
    now, most = best(1.0), float(shares.max())
    if most < now + _BETTER:
        return None
    # Some speeds are as good: the middle one is it.
    alike = _RATIOS[shares >= most - 0.5 / len(key)]
    return Tempo(float(alike[len(alike) // 2]), most, now)
