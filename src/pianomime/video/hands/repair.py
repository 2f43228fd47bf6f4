"""Repair of tracked points: outliers of single frames, gaps and jitter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from pianomime.plan import LEFT

_FAR = 0.025
"""[m] A point this far from where its neighbours in time place it is an outlier."""
_SMOOTH = 5
"""Frames of the smoothing window; a parabola is fitted in it, which causes no lag."""
_AT_REST = np.array(
    [[0.19, 0.0], [0.055, 0.1], [0.0, 0.03], [-0.005, 0.0], [0.0, -0.025], [0.01, -0.05]]
)
"""(6, 2) World x, y of the points of a relaxed left hand, with y relative to the hand [m]."""


def outliers(points: NDArray[np.floating], far: float = _FAR) -> NDArray[np.bool_]:
    """Frames in which a point is far from the middle between the frames before and after.

    A fast movement is not an outlier, because its frames before and after are far apart, too.

    Args:
        points: (T, 2) world x, y of one point [m]; NaN where it was not seen. Unseen points are
            no outliers, and neither are their neighbours.
        far: smallest distance of an outlier [m].

    Returns:
        (T,) bool.
    """
    found = np.zeros(len(points), bool)
    if len(points) >= 3:
        off = np.linalg.norm(points[1:-1] - (points[:-2] + points[2:]) / 2, axis=1)
        found[1:-1] = off > far + np.linalg.norm(points[2:] - points[:-2], axis=1)
    return found


def repair(points: NDArray[np.float32], hand: int) -> NDArray[np.bool_]:
    """Replace outliers, interpolate gaps and smooth the points of one hand, in place.

    Args:
        points: (T, 6, 2) world x, y [m]; NaN where the hand was not seen. If it was never seen,
            all frames become `at_rest`.
        hand: `LEFT` or `RIGHT`.

    Returns:
        (T, 6) bool, points that were outliers.
    """
    frames = len(points)
    replaced = np.zeros(points.shape[:2], bool)
    if not np.isfinite(points).any():
        points[:] = at_rest(hand)
        return replaced
    time = np.arange(frames)
    # Point by point: in hours of video, all of them at once would take much memory.
    for point in range(points.shape[1]):
        replaced[:, point] = outliers(points[:, point])
        known = np.isfinite(points[:, point]).all(axis=1) & ~replaced[:, point]
        for axis in range(2):
            path = np.interp(time, time[known], points[known, point, axis])
            if frames >= _SMOOTH:
                path = savgol_filter(path, _SMOOTH, 2, mode="interp")
            points[:, point, axis] = path
    return replaced


def at_rest(hand: int) -> NDArray[np.float64]:
    """(6, 2) World x, y of the points of a relaxed hand on its side of the keyboard [m].

    Args:
        hand: `LEFT` or `RIGHT`.
    """
    side = -1 if hand == LEFT else 1
    return _AT_REST * [1, -side] + [0.0, 0.2 * side]
