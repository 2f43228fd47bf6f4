"""Points that were seen wrongly for a single frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def strays(points: NDArray[np.floating], far: float) -> NDArray[np.bool_]:
    """(T,) frames in which a point (T, 2) is elsewhere than just before and after.

    Args:
        points: world x, y [m]; NaN, which is no stray and makes none, where it was not seen.
        far: distance [m] from where its neighbours have it from which it is one.
    """
    stray = np.zeros(len(points), bool)
    if len(points) >= 3:
        off = np.linalg.norm(points[1:-1] - (points[:-2] + points[2:]) / 2, axis=1)
        # A quick move is not a stray: there, before and after are apart.
        stray[1:-1] = off > far + np.linalg.norm(points[2:] - points[:-2], axis=1)
    return stray
