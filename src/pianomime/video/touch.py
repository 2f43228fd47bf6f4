"""How near fingertips are to keys."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.video.keyboard import BLACK_FRONT, FRONT
from pianomime.world.figures import BLACK, key_centres

_FREE = 0.003
"""[m] beside the middle of a key that cost nothing."""
_NEAR = 0.007
"""[m] beyond that which cost 1 (it grows with the square)."""
_REACH = 0.010
"""[m] that a fingertip may seem to lie in front of its key: nails and parallax."""


def misfit(points: NDArray[np.float64], key: NDArray[np.int64]) -> NDArray[np.float64]:
    """How badly fingertips fit keys, in squares of about a third of a key's width.

    Args:
        points: (..., 2) world x, y [m].
        key: keys, of a shape that goes with (...).
    """
    beside = np.maximum(np.abs(points[..., 1] - key_centres()[key, 1]) - _FREE, 0.0)
    front = np.where(BLACK[key], BLACK_FRONT, FRONT) + _REACH
    before = np.maximum(points[..., 0] - front, 0.0)
    return np.asarray((beside / _NEAR) ** 2 + (before / _NEAR) ** 2)


def touching(points: NDArray[np.float64]) -> NDArray[np.float32]:
    """(T, 88) how well the best of all fingertips fits each key, 0..1.

    Args:
        points: (T, 2, 6, 2) as in `HandTracks`.
    """
    tips = points[:, :, 1:].reshape(len(points), 10, 1, 2)
    keys = np.arange(88)
    best = np.empty((len(points), 88), np.float32)
    # In blocks: an hour's worth at once would not fit in memory.
    for first in range(0, len(points), 2000):
        part = slice(first, first + 2000)
        best[part] = np.exp(-misfit(tips[part], keys).min(axis=1))
    return best
