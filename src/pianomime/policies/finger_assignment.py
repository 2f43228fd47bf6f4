"""Which finger presses which key, of fingertips that are only about right.

A learned planner says where fingertips go, to about a finger's width. Keys are narrower: so each
key of the goal is given to the finger that is nearest, and that finger put on it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from pianomime.keyboard import BLACK, NO_KEY
from pianomime.world.parameters import key_centres, key_half_sizes

HIGH = 0.045
"""[m] z of fingertips that press nothing (paper, appendix A, step 4)."""
_PRESS = 0.5 * HIGH
"""[m] A fingertip below this was meant to press."""
_MEANT = 0.02
"""[m] By how much nearer a finger counts that was meant to press."""
_FAR = 0.12
"""[m] No finger is taken from farther away than this."""
_EDGE = 0.012
"""[m] that fingertips stay away from the ends of their keys."""
_BEFORE_BLACK = 0.025
"""[m] x from which a fingertip on a white key is clear of the black ones."""


def assign_fingers(
    tips: NDArray[np.float64], goal: NDArray[np.bool_], before: NDArray[np.int8]
) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Fingertips on the keys of a goal.

    A finger that held a key goes on holding it. All other keys are given out so that the fingers
    go the least way in all; keys beyond the tenth, or far from any finger, are left out.

    Args:
        tips: (2, 6, 3) where a planner wants the points [m].
        goal: (88,) keys that should be down.
        before: (2, 5) the key that each finger pressed in the frame before, -1 for none.

    Returns:
        The points, pressing ones at z = 0 and idle ones high, and the key of each finger (2, 5).
    """
    centres = key_centres()
    held = (before >= 0) & goal[np.maximum(before, 0)]
    finger_key = np.where(held, before, NO_KEY).astype(np.int8)
    free = np.flatnonzero(~held.ravel())
    wanted = goal.copy()
    wanted[finger_key[held]] = False
    keys = np.flatnonzero(wanted)
    points = tips[:, 1:].reshape(10, 3)
    if len(keys) and len(free):
        off = np.abs(points[free, None, 1] - centres[keys, 1])
        cost = off - _MEANT * (points[free, None, 2] < _PRESS)
        rows, columns = linear_sum_assignment(np.where(off > _FAR, 1e3, cost))
        for row, column in zip(rows, columns, strict=True):
            if off[row, column] <= _FAR:
                finger_key.reshape(10)[free[row]] = keys[column]
    snapped = flat_heights(tips, finger_key)
    hand, finger = np.nonzero(finger_key >= 0)
    key = finger_key[hand, finger]
    snapped[hand, finger + 1, 1] = centres[key, 1]
    far, near = (
        centres[key, 0] + side * (key_half_sizes()[key, 0] - _EDGE) for side in (-1.0, 1.0)
    )
    far = np.where(BLACK[key], far, _BEFORE_BLACK)
    snapped[hand, finger + 1, 0] = np.clip(snapped[hand, finger + 1, 0], far, near)
    return snapped, finger_key


def flat_heights(tips: NDArray[np.float64], finger_key: NDArray[np.int8]) -> NDArray[np.float64]:
    """Points (..., 2, 6, 3) with heights that tell which fingers press (paper, appendix A, step 4).

    Args:
        tips: points [m].
        finger_key: (..., 2, 5) the key that each finger presses, -1 for none.

    Returns:
        The points, at z = 0 where they press and high where not.
    """
    flat = tips.copy()
    flat[..., 2] = HIGH
    flat[..., 1:, 2][finger_key >= 0] = 0.0
    return flat
