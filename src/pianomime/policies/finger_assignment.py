"""Which finger presses which key, for predicted fingertips that are only roughly right.

A learned planner predicts fingertips to about a finger's width, and keys are narrower. So each key
of the goal is assigned to the nearest finger, and that fingertip is moved onto the key. Its hand
moves along with it, so that the next prediction begins where the hand has to be.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from pianomime.keyboard import BLACK, NO_KEY
from pianomime.plan.fingertip_plan import HOVER_HEIGHT, FingertipPlan
from pianomime.world.layout import FINGER_COUNT
from pianomime.world.parameters import key_centres, key_half_sizes

_PRESS_HEIGHT = 0.5 * HOVER_HEIGHT
"""[m] z below which a predicted fingertip is taken for one that presses."""
_PRESS_BONUS = 0.02
"""[m] Distance taken off the cost of a finger that was predicted to press."""
_MAX_DISTANCE = 0.045
"""[m] along the keyboard beyond which no finger is given a new key: about two white keys. Who
reaches farther misses the notes that follow."""
_UNREACHABLE = 1e3
"""Cost of a finger farther away than that; greater than the sum of all others."""
_END_MARGIN = 0.012
"""[m] that fingertips keep from the ends of their keys."""
_WHITE_MIN_X = 0.025
"""[m] x from which a fingertip on a white key is clear of the black ones."""


def assign_fingers(
    points: NDArray[np.float64], goal: NDArray[np.bool_], previous: NDArray[np.int8]
) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
    """Assign the keys of a goal to fingers, and put these fingertips on them.

    A finger that held a key goes on holding it. The other keys are assigned so that the sum of the
    distances is smallest (Kuhn, "The Hungarian method for the assignment problem", 1955); keys
    beyond the tenth, and those far from every finger, are left out.

    Args:
        points: (2, 6, 3) predicted wrists and fingertips, world frame [m].
        goal: (88,) keys that should be down.
        previous: (2, 5) the key that each finger pressed in the frame before, -1 for none.

    Returns:
        The points (2, 6, 3), fingertips that press at z = 0 on their keys and all others at hover
        height; and the key of each finger (2, 5), -1 for none. Where fingers of a hand press, its
        other points are moved along the keyboard as far as these are in the mean.
    """
    centres = key_centres()
    held = (previous >= 0) & goal[np.maximum(previous, 0)]
    finger_key = np.where(held, previous, NO_KEY).astype(np.int8)
    free = np.flatnonzero(~held.ravel())
    open_goal = goal.copy()
    open_goal[finger_key[held]] = False
    keys = np.flatnonzero(open_goal)
    tips = points[:, 1:].reshape(2 * FINGER_COUNT, 3)
    if len(keys) and len(free):
        distance = np.abs(tips[free, None, 1] - centres[keys, 1])
        cost = distance - _PRESS_BONUS * (tips[free, None, 2] < _PRESS_HEIGHT)
        rows, columns = linear_sum_assignment(
            np.where(distance > _MAX_DISTANCE, _UNREACHABLE, cost)
        )
        for row, column in zip(rows, columns, strict=True):
            if distance[row, column] <= _MAX_DISTANCE:
                finger_key.reshape(-1)[free[row]] = keys[column]
    moved = points.copy()
    for hand, pressing in enumerate(finger_key >= 0):
        if pressing.any():
            away = centres[finger_key[hand, pressing], 1] - points[hand, 1:][pressing, 1]
            moved[hand, :, 1] += away.mean()
    return onto_keys(flat_heights(moved, finger_key), finger_key), finger_key


def onto_keys(points: NDArray[np.float64], finger_key: NDArray[np.int8]) -> NDArray[np.float64]:
    """Points whose pressing fingertips are over the middle of their keys, and not off their ends.

    Args:
        points: (2, 6, 3) wrists and fingertips, world frame [m].
        finger_key: (2, 5) the key that each finger presses, -1 for none.
    """
    moved, centres = points.copy(), key_centres()
    hand, finger = np.nonzero(finger_key >= 0)
    key = finger_key[hand, finger]
    moved[hand, finger + 1, 1] = centres[key, 1]
    far, near = (
        centres[key, 0] + side * (key_half_sizes()[key, 0] - _END_MARGIN) for side in (-1.0, 1.0)
    )
    far = np.where(BLACK[key], far, _WHITE_MIN_X)
    moved[hand, finger + 1, 0] = np.clip(moved[hand, finger + 1, 0], far, near)
    return moved


def flat_heights(points: NDArray[Any], finger_key: NDArray[np.int8]) -> NDArray[Any]:
    """Points with z that tells which fingers press (paper, appendix A, step 4).

    Args:
        points: (..., 2, 6, 3) world frame [m].
        finger_key: (..., 2, 5) the key that each finger presses, -1 for none.

    Returns:
        The points (..., 2, 6, 3), of the same precision, at z = 0 where they press and at hover
        height where not.
    """
    flat = points.copy()
    flat[..., 2] = HOVER_HEIGHT
    flat[..., 1:, 2][finger_key >= 0] = 0.0
    return flat


def flat_plan(plan: FingertipPlan) -> FingertipPlan:
    """A plan as low-level policies follow it, with heights as of `flat_heights`."""
    return replace(plan, fingertips=flat_heights(plan.fingertips, plan.finger_key))
