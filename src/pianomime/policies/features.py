"""What generalists see and say, in numbers: the same in training and when they play."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.world.hand import both_hands, hand_points
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres

TIPS = 36
"""Numbers of both hands' points, (2, 6, 3) in a row."""
JOINTS = 2 * LAYOUT.hand_joints
CONTROLS = 2 * LAYOUT.hand_actuators

Arrays = dict[str, NDArray[np.float32]]
"""`goal` (B, G, 88), `frames` (B, C, F) and `vector` (B, V): what a network is given."""


def high_inputs(goal: NDArray[np.bool_], tips: NDArray[np.floating]) -> Arrays:
    """What the high level sees.

    Args:
        goal: (B, 10, 88) of this frame and those that follow.
        tips: (B, 2, 6, 3) where forearms and fingertips are [m].
    """
    return {
        "goal": goal.astype(np.float32),
        "frames": np.zeros((len(goal), goal.shape[1], 0), np.float32),
        "vector": from_wrists(tips).reshape(len(tips), TIPS).astype(np.float32),
    }


def from_wrists(points: NDArray[np.floating]) -> NDArray[np.floating]:
    """Points (..., 2, 6, 3) with the fingertips told from where their forearm is.

    So hands do not come apart where a policy goes on from what it said before.
    """
    told = points.copy()
    told[..., 1:, :] -= points[..., :1, :]
    return told


def to_world(told: NDArray[np.floating]) -> NDArray[np.floating]:
    """Points (..., 2, 6, 3) in the world, of what `from_wrists` told."""
    points = told.copy()
    points[..., 1:, :] += told[..., :1, :]
    return points


def low_inputs(
    goal: NDArray[np.bool_],
    targets: NDArray[np.floating] | None,
    tips: NDArray[np.floating],
    joints: NDArray[np.floating],
    velocities: NDArray[np.floating],
    keys: NDArray[np.floating],
    prior: NDArray[np.floating] | None,
) -> Arrays:
    """What the low level sees, or a policy of one stage.

    Args:
        goal: (B, C, 88) of this frame and those that follow.
        targets: (B, C, 2, 6, 3) the plan's points in these frames [m]; None for one stage.
        tips: (B, 2, 6, 3) where the points are [m].
        joints: (B, 54) right, left [rad, m].
        velocities: (B, 54) the same [rad/s, m/s].
        keys: (B, 88) how far each is down.
        prior: (B, 46) what inverse kinematics proposes for this frame [rad, m], where it is seen.
    """
    batch, chunk = goal.shape[:2]
    if targets is None:
        frames = np.zeros((batch, chunk, 0))
    else:
        off = targets - tips[:, None]
        frames = np.concatenate([targets, off], axis=2).reshape(batch, chunk, 2 * TIPS)
    parts = [joints, velocities, keys, tips.reshape(batch, TIPS)]
    if prior is not None:
        parts.append(prior)
    return {
        "goal": goal.astype(np.float32),
        "frames": frames.astype(np.float32),
        "vector": np.concatenate(parts, axis=1).astype(np.float32),
    }


@cache
def rest_tips() -> NDArray[np.float64]:
    """(2, 6, 3) [m] where the points are at rest; read-only."""
    tips: NDArray[np.float64] = hand_points(np.zeros((1, JOINTS)))[0]
    tips.setflags(write=False)
    return tips


def octave() -> float:
    """How far [m] an octave is along the keyboard."""
    centres = key_centres()
    return float(centres[12, 1] - centres[0, 1])


def base(level: str, prior: bool, vector: NDArray[np.float32]) -> NDArray[np.float32]:
    """What chunks are told relative to, (B, 1, D).

    Controls to those that hold the present pose, so that a network need not tell millimetres in
    numbers that span the keyboard; fingertips, and what is added to a prior, to nothing.

    Args:
        level: "high", "low" or "whole".
        prior: whether controls are told as what to add to a prior.
        vector: (B, V) what is seen.
    """
    if level == "high":
        return np.zeros((len(vector), 1, TIPS), np.float32)
    if prior:
        return np.zeros((len(vector), 1, CONTROLS), np.float32)
    held: NDArray[np.float32] = holding(vector[:, :JOINTS])[:, None]
    return held


def holding(joints: NDArray[Any]) -> NDArray[Any]:
    """(B, 46) the controls that hold joints (B, 54), without load [rad, m]; in their precision."""
    held: NDArray[Any] = joints @ _to_controls().T
    return held


@cache
def _to_controls() -> NDArray[np.float32]:
    """(46, 54) from joints to the controls that hold them, without load."""
    matrix = np.zeros((CONTROLS, JOINTS), np.float32)
    for hand in both_hands():
        joints = slice(hand.joints.start - KEYS, hand.joints.stop - KEYS)
        matrix[hand.actuators, joints] = hand.to_ctrl
    return matrix
