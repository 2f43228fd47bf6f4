"""How near fingertips are to keys."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK
from pianomime.video.keyboard.geometry import BLACK_FRONT, FRONT
from pianomime.world.parameters import key_centres

_FREE = 0.003
"""[m] beside the middle of a key that cost nothing."""
_NEAR = 0.007
"""[m] beyond that which cost 1 (it grows with the square)."""
_REACH = 0.010
"""[m] that a fingertip may seem to lie in front of its key: nails and parallax."""

_BLOCK = 10_000
"""Frames."""


def misfit(points: NDArray[np.floating], key: NDArray[np.int64] | np.int64) -> NDArray[np.float64]:
    """How badly fingertips fit keys, in squares of about a third of a key's width.

    Args:
        points: (..., 2) world x, y [m]; a z behind them does no harm.
        key: keys, of a shape that goes with (...).
    """
    beside = np.maximum(np.abs(points[..., 1] - key_centres()[key, 1]) - _FREE, 0.0)
    front = np.where(BLACK[key], BLACK_FRONT, FRONT) + _REACH
    before = np.maximum(points[..., 0] - front, 0.0)
    return np.asarray((beside / _NEAR) ** 2 + (before / _NEAR) ** 2)


def touching(points: NDArray[np.floating], key: int) -> NDArray[np.float32]:
    """(T,) how well the best of all fingertips fits a key, 0..1.

    Args:
        points: (T, H, 6, 2) as `HandTracks.seen_points` gives them.
        key: 0..87.
    """
    best = np.empty(len(points), np.float32)
    # In blocks: hours at once take much memory.
    for first in range(0, len(points), _BLOCK):
        part = slice(first, first + _BLOCK)
        off = misfit(points[part, :, 1:], np.int64(key)).min(axis=(1, 2), initial=np.inf)
        best[part] = np.exp(-off)
    return best
