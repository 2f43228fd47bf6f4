"""Observation encoding and action decoding of the learned policies, shared by training and play.

An observation is three arrays: `goal` (B, G, 88), the goals of G frames from the present one on;
`frames` (B, G, F), further features of each of these frames, F = 0 where there are none; and
`vector` (B, V), all that belongs to the present frame. All are float32.

The points of both hands, (2, 6, 3), are wrist and fingertips, thumb first, of the left and of the
right hand. Joints and controls are those of the right and then of the left hand, as in a World.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.world.hand import both_hands, hand_points
from pianomime.world.layout import LAYOUT, POINTS_SIZE
from pianomime.world.parameters import key_centres

Observation = dict[str, NDArray[np.float32]]
"""`goal`, `frames` and `vector`: the inputs of a network."""
OCTAVE = 12
"""Keys of an octave."""


def fingertip_observation(goal: NDArray[np.bool_], points: NDArray[np.floating]) -> Observation:
    """Observation of the high-level policy, which predicts fingertips.

    Args:
        goal: (B, 10, 88) keys that should be down in this frame and in those that follow.
        points: (B, 2, 6, 3) present wrists and fingertips in the world frame [m].
    """
    return {
        "goal": goal.astype(np.float32),
        "frames": np.zeros((len(goal), goal.shape[1], 0), np.float32),
        "vector": relative_to_wrist(points).reshape(len(points), POINTS_SIZE).astype(np.float32),
    }


def relative_to_wrist(points: NDArray[np.floating]) -> NDArray[np.floating]:
    """Points (..., 2, 6, 3) [m] with the fingertips relative to their wrist.

    Hands then keep their shape when a high-level policy continues from its own predictions. Wrists
    stay in the world frame.
    """
    relative = points.copy()
    relative[..., 1:, :] -= points[..., :1, :]
    return relative


def to_world_frame(relative: NDArray[np.floating]) -> NDArray[np.floating]:
    """Points (..., 2, 6, 3) [m] in the world frame; the inverse of `relative_to_wrist`."""
    points = relative.copy()
    points[..., 1:, :] += relative[..., :1, :]
    return points


def tracking_observation(
    goal: NDArray[np.bool_],
    targets: NDArray[np.floating] | None,
    points: NDArray[np.floating],
    joints: NDArray[np.floating],
    velocities: NDArray[np.floating],
    keys: NDArray[np.floating],
    base: NDArray[np.floating] | None,
) -> Observation:
    """Observation of the low-level policy, and of an end-to-end one; both predict controls.

    Args:
        goal: (B, 4, 88) keys that should be down in this frame and in those that follow.
        targets: (B, 4, 2, 6, 3) planned points in these frames, world frame [m]; None for an
            end-to-end policy.
        points: (B, 2, 6, 3) present points, world frame [m].
        joints: (B, 54) positions of the hands' joints [rad, m].
        velocities: (B, 54) their velocities [rad/s, m/s].
        keys: (B, 88) how far each key is down, 0..1.
        base: (B, 46) control of the base controller for this frame [rad, m]; None unless the
            policy is a residual one.
    """
    batch, chunk = goal.shape[:2]
    if targets is None:
        frames = np.zeros((batch, chunk, 0))
    else:
        error = targets - points[:, None]
        frames = np.concatenate([targets, error], axis=2).reshape(batch, chunk, 2 * POINTS_SIZE)
    parts = [joints, velocities, keys, points.reshape(batch, POINTS_SIZE)]
    if base is not None:
        parts.append(base)
    return {
        "goal": goal.astype(np.float32),
        "frames": frames.astype(np.float32),
        "vector": np.concatenate(parts, axis=1).astype(np.float32),
    }


@cache
def rest_points() -> NDArray[np.float64]:
    """(2, 6, 3) [m] points of the hands at rest, world frame; read-only."""
    points: NDArray[np.float64] = hand_points(np.zeros((1, LAYOUT.hands_size)))[0]
    points.setflags(write=False)
    return points


def octave_width() -> float:
    """Length of an octave along the keyboard [m]."""
    centres = key_centres()
    return float(centres[OCTAVE, 1] - centres[0, 1])


def action_reference(
    level: str, residual: bool, vector: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Reference that action chunks are relative to, (B, 1, D).

    Controls are relative to those that hold the present pose, so that a network need not resolve
    millimetres in numbers that span the keyboard. Fingertips and residuals are relative to 0.

    Args:
        level: as `PolicyInfo.level`.
        residual: as `PolicyInfo.residual`.
        vector: (B, V) of the observation; joints come first in those of controls.
    """
    if level == "high":
        return np.zeros((len(vector), 1, POINTS_SIZE), np.float32)
    if residual:
        return np.zeros((len(vector), 1, LAYOUT.ctrl_size), np.float32)
    held: NDArray[np.float32] = holding_controls(vector[:, : LAYOUT.hands_size])[:, None]
    return held


def holding_controls(joints: NDArray[Any]) -> NDArray[Any]:
    """(B, 46) controls that hold joints (B, 54) in place without load [rad, m]; same precision."""
    held: NDArray[Any] = joints @ _joints_to_controls().T
    return held


@cache
def _joints_to_controls() -> NDArray[np.float32]:
    """(46, 54) matrix from joints to the controls that hold them without load."""
    matrix = np.zeros((LAYOUT.ctrl_size, LAYOUT.hands_size), np.float32)
    for index, hand in enumerate(both_hands()):
        matrix[hand.actuators, LAYOUT.among_hands(index)] = hand.to_ctrl
    return matrix
