"""The second stage: where wrist and fingertips of a hand go, given what its fingers press.

Both hands share a network: the left one is seen in a mirror. Places along the keyboard are relative
to the wrist, so what is learned in one octave holds in all.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK
from pianomime.policies.features import rest_points
from pianomime.policies.finger_assignment import flat_heights, onto_keys
from pianomime.policies.horizon import CHUNK
from pianomime.policies.policy import Inference
from pianomime.policies.three_stage.fingering import FingeringRollout
from pianomime.world.layout import FINGER_COUNT, POINT_COUNT
from pianomime.world.parameters import key_centres

MIRROR = np.array([-1.0, 1.0])
"""(2,) Direction along the keyboard in which a hand's little finger is: left, right."""
_AHEAD = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 13, 15, 18, 21, 25, 29)
"""Frames ahead in which it is observed what fingers press."""
PRESSES = _AHEAD[-1] + 1
"""Frames of presses that are observed: the present one and those that follow."""
PLANE = 2 * POINT_COUNT
"""Numbers of an action for one frame: x and y of wrist and fingertips; heights follow from what is
pressed."""
_HAND = 0.1
"""Unit of distances to keys [m]; they are clipped to 8 units."""
_MOST = 8.0
_LENGTH = 0.05
"""Unit of the shape of a hand [m]."""
_MOVE = 0.02
"""Unit of the motion in one frame [m]."""
_SOON = 8.0
"""Time constant of the time until a press [frames]."""
_PARTS = {
    "presses": len(_AHEAD) * FINGER_COUNT,
    "distance to keys": len(_AHEAD) * FINGER_COUNT,
    "keys are black": len(_AHEAD) * FINGER_COUNT,
    "will press": FINGER_COUNT,
    "how soon": FINGER_COUNT,
    "distance to next key": FINGER_COUNT,
    "next key is black": FINGER_COUNT,
    "shape": PLANE,
    "motion": PLANE,
}
"""Parts of the observation of a hand, in order, with their sizes."""
SIZE = sum(_PARTS.values())
"""Size of the observation of a hand."""


def motion_observation(
    presses: NDArray[np.int8],
    points: NDArray[np.floating],
    before: NDArray[np.floating],
    side: NDArray[np.int64],
) -> NDArray[np.float32]:
    """What is observed of B hands.

    Args:
        presses: (B, PRESSES, 5) the key that each finger presses in this frame and in those that
            follow, -1 for none.
        points: (B, 6, 2) x and y of wrist and fingertips in the frame before [m].
        before: (B, 6, 2) the same, a frame earlier [m].
        side: (B,) 0 left, 1 right.

    Returns:
        (B, SIZE).
    """
    along, mirror = key_centres()[:, 1], MIRROR[side]
    wrist = points[:, 0, 1]
    keys = presses[:, list(_AHEAD)]

    def distance(keys: NDArray[np.int8]) -> NDArray[np.float64]:
        shape = (-1, *[1] * (keys.ndim - 1))
        apart = (along[keys] - wrist.reshape(shape)) * mirror.reshape(shape) / _HAND
        return np.where(keys >= 0, np.clip(apart, -_MOST, _MOST), 0.0)

    down = presses >= 0
    soon = down.argmax(axis=1)
    next_key = np.take_along_axis(presses, soon[:, None], axis=1)[:, 0]
    parts = {
        "presses": keys >= 0,
        "distance to keys": distance(keys),
        "keys are black": (keys >= 0) & BLACK[keys],
        "will press": next_key >= 0,
        "how soon": np.where(next_key >= 0, np.exp(-soon / _SOON), 0.0),
        "distance to next key": distance(next_key),
        "next key is black": (next_key >= 0) & BLACK[next_key],
        "shape": _mirrored(_from_wrist(points, points), mirror) / _LENGTH,
        "motion": _mirrored(points - before, mirror) / _MOVE,
    }
    rows = [parts[name].reshape(len(presses), -1) for name in _PARTS]
    return np.concatenate(rows, axis=1).astype(np.float32)


def motion_action(
    future: NDArray[np.floating], points: NDArray[np.floating], side: NDArray[np.int64]
) -> NDArray[np.float32]:
    """The action of moving B hands to points in frames to come.

    Args:
        future: (B, CHUNK, 6, 2) x and y of wrist and fingertips [m].
        points: (B, 6, 2) the same in the frame before [m].
        side: (B,) 0 left, 1 right.

    Returns:
        (B, CHUNK, PLANE): the wrist relative to where it was along the keyboard, and fingertips
        relative to the wrist along it, mirrored for left hands [m].
    """
    relative = _from_wrist(future, points[:, None])
    relative[..., 1:, 1] -= relative[..., :1, 1]
    mirrored = _mirrored(relative, MIRROR[side])
    return mirrored.reshape(len(future), CHUNK, PLANE).astype(np.float32)


def points_of_action(
    action: NDArray[np.floating], points: NDArray[np.floating], side: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(B, CHUNK, 6, 2) The points [m] of actions (B, CHUNK, PLANE); undoes `motion_action`."""
    relative = action.astype(np.float64).reshape(len(action), CHUNK, POINT_COUNT, 2)
    future = _mirrored(relative, MIRROR[side])
    future[..., 1:, 1] += future[..., :1, 1]
    future[..., 1] += points[:, None, :1, 1]
    return future


class HandMotionRollout:
    """Asks the networks for the points of each frame, in order; it sees what it said before.

    Args:
        fingering: what the fingers press.
        policy: the network: `observation` (2, SIZE) to `action` (2, CHUNK, PLANE).
    """

    def __init__(self, fingering: FingeringRollout, policy: Inference) -> None:
        self._fingering, self._policy = fingering, policy
        self._presses = deque(fingering.step() for _ in range(PRESSES - 1))
        self._points = self._before = rest_points()[..., :2]

    def step(self) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
        """The points (2, 6, 3) [m] of the next frame, and what its fingers press (2, 5)."""
        self._presses.append(self._fingering.step())
        ahead = np.array(self._presses).swapaxes(0, 1)
        side = np.arange(2)
        observation = motion_observation(ahead, self._points, self._before, side)
        action = self._policy({"observation": observation})[0]
        plane = points_of_action(action, self._points, side)[:, 0]
        finger_key = self._presses.popleft()
        points = onto_keys(flat_heights(_with_height(plane), finger_key), finger_key)
        self._before, self._points = self._points, points[..., :2]
        return points, finger_key


def _with_height(plane: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (..., 3) of points (..., 2), in the plane of the keys [m]."""
    return np.concatenate([plane, np.zeros((*plane.shape[:-1], 1))], axis=-1)


def _from_wrist(points: NDArray[np.floating], origin: NDArray[np.floating]) -> NDArray[np.floating]:
    """Points (..., 6, 2) with y relative to the wrist of others (..., 6, 2) [m]."""
    relative = points.copy()
    relative[..., 1] -= origin[..., :1, 1]
    return relative


def _mirrored(points: NDArray[np.floating], mirror: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (B, ..., 2) with y multiplied by (B,)."""
    mirrored = points.astype(np.float64)
    mirrored[..., 1] *= mirror.reshape(-1, *[1] * (points.ndim - 2))
    return mirrored
