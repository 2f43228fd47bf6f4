"""The third stage: the controls of a hand that take its fingertips where they are wanted.

As in the stage before, both hands share a network, and it does not see where on the keyboard a hand
is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK
from pianomime.policies.three_stage.hand_motion import MIRROR
from pianomime.world.hand import both_hands
from pianomime.world.layout import FINGER_COUNT, LAYOUT, POINT_COUNT

TARGETS = 8
"""Frames of targets that are observed: the present one and those that follow. A forearm takes five
to arrive."""
ACTIONS = LAYOUT.hand_actuators
"""Numbers of an action: the actuators of a hand."""
_SLIDE = LAYOUT.slide_actuators.start
"""The actuator of the forearm along the keyboard; all others are alike in both hands."""
_SPEED = 5.0
"""Unit of the velocities of joints [rad/s, m/s]; they are clipped to 5 units."""
_LENGTH = 0.05
"""Unit of the shape of a hand [m]."""
_ERROR = 0.03
"""Unit of the distances to targets [m]; they are clipped to 8 units."""
_MOST = 8.0
_PARTS = {
    "joints": LAYOUT.hand_joints,
    "velocities": LAYOUT.hand_joints,
    "shape": POINT_COUNT * 3,
    "distance to targets": TARGETS * POINT_COUNT * 2,
    "presses": TARGETS * FINGER_COUNT,
    "keys are black": TARGETS * FINGER_COUNT,
    "key states": FINGER_COUNT,
}
"""Parts of the observation of a hand, in order, with their sizes."""
SIZE = sum(_PARTS.values())
"""Size of the observation of a hand."""


def controls_observation(
    joints: NDArray[np.floating],
    velocities: NDArray[np.floating],
    key_state: NDArray[np.floating],
    points: NDArray[np.floating],
    targets: NDArray[np.floating],
    presses: NDArray[np.int8],
    side: NDArray[np.int64],
) -> NDArray[np.float32]:
    """What is observed of B hands.

    Args:
        joints: (B, 27) positions [rad, m].
        velocities: (B, 27) [rad/s, m/s].
        key_state: (B, 88) how far each key is down, 0..1.
        points: (B, 6, 3) wrist and fingertips [m].
        targets: (B, TARGETS, 6, 3) where they are wanted in this frame and in those that follow
            [m]; heights do not count.
        presses: (B, TARGETS, 5) the key that each finger is to press then, -1 for none.
        side: (B,) 0 left, 1 right.

    Returns:
        (B, SIZE).
    """
    mirror = MIRROR[side]
    joints, velocities = joints.astype(np.float64), velocities.astype(np.float64)
    # Where on the keyboard the hand is does not matter.
    joints[:, LAYOUT.slide] = 0.0
    velocities[:, LAYOUT.slide] *= mirror
    shape = points.astype(np.float64)
    shape[..., 1] = (shape[..., 1] - shape[:, :1, 1]) * mirror[:, None]
    error = (targets - points[:, None])[..., :2]
    error[..., 1] *= mirror[:, None, None]
    down, own = presses >= 0, presses[:, 0]
    parts = {
        "joints": joints,
        "velocities": np.clip(velocities / _SPEED, -_SPEED, _SPEED),
        "shape": shape / _LENGTH,
        "distance to targets": np.clip(error / _ERROR, -_MOST, _MOST),
        "presses": down,
        "keys are black": down & BLACK[presses],
        "key states": np.where(own >= 0, np.take_along_axis(key_state, own.astype(int), 1), 0.0),
    }
    rows = [parts[name].reshape(len(joints), -1) for name in _PARTS]
    return np.concatenate(rows, axis=1).astype(np.float32)


def controls_action(
    ctrl: NDArray[np.floating], joints: NDArray[np.floating], side: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(B, 23) The action of controls (B, 23) in poses (B, 27) of hands [rad, m].

    It is relative to the controls that hold the pose, and mirrored for left hands (`side` 0).
    """
    action: NDArray[np.float64] = ctrl - _held(joints)
    action[:, _SLIDE] *= MIRROR[side]
    return action


def controls_of_action(
    action: NDArray[np.floating], joints: NDArray[np.floating], side: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(B, 23) The controls [rad, m] of actions (B, 23); undoes `controls_action`."""
    moved = action.astype(np.float64)
    moved[:, _SLIDE] *= MIRROR[side]
    ctrl: NDArray[np.float64] = moved + _held(joints)
    return ctrl


def _held(joints: NDArray[np.floating]) -> NDArray[np.float64]:
    """(B, 23) Controls that hold poses (B, 27) without load [rad, m]; both hands are alike."""
    return joints @ both_hands()[0].to_ctrl.T
