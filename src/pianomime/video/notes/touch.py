"""Measures of how near fingertips are to keys."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK
from pianomime.video.keyboard.geometry import BLACK_FRONT, FRONT
from pianomime.world.parameters import key_centres

_FREE = 0.003
"""[m] Distance from the middle line of a key that costs nothing."""
_NEAR = 0.007
"""[m] Further distance that costs 1; the cost grows with its square."""
_REACH = 0.010
"""[m] Distance in front of a key that costs nothing, due to finger nails and parallax."""

_BLOCK = 10_000
"""Frames that are computed at once."""


def misfit(points: NDArray[np.floating], key: NDArray[np.int64] | np.int64) -> NDArray[np.float64]:
    """Squared distance of fingertips from keys, in units of about a third of a key's width.

    Args:
        points: (..., 2) or (..., 3) world x, y and z [m]; z is not used.
        key: (...) keys, or one for all points.

    Returns:
        (...) misfit, 0 on the key.
    """
    beside = np.maximum(np.abs(points[..., 1] - key_centres()[key, 1]) - _FREE, 0.0)
    front = np.where(BLACK[key], BLACK_FRONT, FRONT) + _REACH
    before = np.maximum(points[..., 0] - front, 0.0)
    return np.asarray((beside / _NEAR) ** 2 + (before / _NEAR) ** 2)


def touching(points: NDArray[np.floating], key: int) -> NDArray[np.float32]:
    """(T,) How well the nearest fingertip fits a key: 1 on the key, falling to 0.

    Args:
        points: (T, H, 6, 2) as `HandTracks.seen_points` returns them.
        key: the key, 0..87.
    """
    best = np.empty(len(points), np.float32)
    # In blocks, because hours at once take much memory.
    for first in range(0, len(points), _BLOCK):
        part = slice(first, first + _BLOCK)
        off = misfit(points[part, :, 1:], np.int64(key)).min(axis=(1, 2), initial=np.inf)
        best[part] = np.exp(-off)
    return best
