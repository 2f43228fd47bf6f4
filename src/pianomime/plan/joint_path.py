"""A smooth path of joint positions that leads fingertips through their targets.

Inverse kinematics over a whole piece at once: every frame sees what comes later, so a hand sets
off for a leap in time, and fingers that do not play stay out of the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from pianomime.keyboard import BLACK, FRAME_SECONDS
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres, key_half_sizes

HOME = np.array(
    [0.0, 0.0, -0.01, -0.1, -0.05]
    + [0.0, 0.83, 0.65, 0.65]
    + [0.0, 0.79, 0.61, 0.61]
    + [0.0, 0.76, 0.57, 0.57]
    + [0.05, 0.0, 0.74, 0.55, 0.55]
    + [0.13, 0.84, 0.0, 0.0, 0.2]
)
"""(27,) joint positions of a hand curved over the keys, for either hand [rad, m]."""

TIP_RADIUS = 0.0085
"""[m] From a fingertip's site to where it touches a key."""
WHITE_REST, BLACK_REST = (
    float(key_centres()[key, 2] + key_half_sizes()[key, 2]) + TIP_RADIUS for key in (0, 1)
)
"""[m] Height of a fingertip's site when it rests on a white or a black key."""
KEY_REST = np.where(BLACK, BLACK_REST, WHITE_REST)
"""(88,) [m] The same, key by key."""

# Joints 2 and 1 of each finger hang on one tendon and turn together when nothing touches them.
_HELD = 1e9
_COUPLED = [(7, 8), (11, 12), (15, 16), (20, 21)]


@dataclass(frozen=True)
class PathConfig:
    """How a path weighs its wishes; each weight is one over a deviation that counts as 1."""

    slide_acceleration: float = 40.0
    """[m/s^2] of the forearm."""
    joint_acceleration: float = 400.0
    """[rad/s^2] of wrist and fingers."""
    posture: float = 3.0
    """[rad] away from the home pose."""
    slide_posture: float = 0.1
    """[m] of the forearm toward and away from the piano."""
    coupling: float = 0.15
    """[rad] between the two end joints of a finger."""
    floor: float = 0.002
    """[m] below the floor that keeps idle fingertips off the keys."""
    damping: float = 0.3
    """[rad, m] of a joint in one step."""
    step: float = 0.4
    """[rad, m] that a joint moves at most in one step."""
    iterations: int = 10
    """Gauss-Newton steps."""


def smooth_path(
    hand: Hand,
    start: NDArray[np.float64],
    targets: NDArray[np.float64],
    weights: NDArray[np.float64],
    clearance: NDArray[np.float64],
    config: PathConfig | None = None,
) -> NDArray[np.float64]:
    """Joint positions at the end of each of T frames.

    Args:
        hand: whose path.
        start: (27,) joint positions before the first frame, where the hand rests.
        targets: (T, 6, 3) [m] where wrist and fingertips should be at the end of each frame.
        weights: (T, 6, 3) [1/m] one over the deviation from the target that counts as 1.
        clearance: (T, 5) [m] how far above the keys a fingertip should stay; nan for fingers
            that may go down.
        config: the other weights.

    Returns:
        (T + 1, 27) joint positions [rad, m]; the first row is `start`.
    """
    config = config or PathConfig()
    frames = len(targets)
    posture = _posture_weights(config)
    coupling = _coupling_hessian(config)
    stiffness = _acceleration_weights(config)
    home = np.clip(HOME, hand.low, hand.high)
    path = np.tile(home, (frames, 1))
    path[:, 0] = _slide_guess(hand, targets, weights)
    damping = config.damping**-2
    for _ in range(config.iterations):
        gradient = np.empty((frames, LAYOUT.hand_joints))
        blocks = np.empty((frames, LAYOUT.hand_joints, LAYOUT.hand_joints))
        for frame in range(frames):
            points, jacobian = hand.points_and_jacobian(path[frame])
            error = (points - targets[frame]) * weights[frame]
            rows = jacobian * weights[frame][..., None]
            lack = points[1:, 2] - clearance[frame] - resting_height(points[1:, 0])
            below = lack < 0.0
            error[1:, 2][below] = lack[below] / config.floor
            rows[1:, 2][below] = jacobian[1:, 2][below] / config.floor
            rows = rows.reshape(-1, LAYOUT.hand_joints)
            blocks[frame] = rows.T @ rows
            gradient[frame] = rows.T @ error.ravel()
        gradient += posture * (path - home) + path @ coupling
        blocks += np.diag(posture + damping) + coupling
        # A joint at a limit that it is pushed against stays there for this step.
        held = ((path <= hand.low) & (gradient > 0)) | ((path >= hand.high) & (gradient < 0))
        blocks[:, np.arange(LAYOUT.hand_joints), np.arange(LAYOUT.hand_joints)] += held * _HELD
        step = _step(blocks, gradient, stiffness, path, start)
        path = np.clip(path + np.clip(step, -config.step, config.step), hand.low, hand.high)
    return np.vstack([start, path])


def resting_height(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height [m] of a fingertip's site when it rests on the keys at `x` [m].

    The black keys' tops count wherever a fingertip could touch one.
    """
    onto_black = np.clip((0.03 - x) / 0.01, 0.0, 1.0)
    return WHITE_REST + (BLACK_REST - WHITE_REST) * onto_black


def _posture_weights(config: PathConfig) -> NDArray[np.float64]:
    weights = np.full(LAYOUT.hand_joints, config.posture**-2)
    weights[0] = 0.0
    weights[1:3] = config.slide_posture**-2
    return weights


def _coupling_hessian(config: PathConfig) -> NDArray[np.float64]:
    hessian = np.zeros((LAYOUT.hand_joints, LAYOUT.hand_joints))
    for one, other in _COUPLED:
        pair = np.ix_([one, other], [one, other])
        hessian[pair] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / config.coupling**2
    return hessian


def _slide_guess(
    hand: Hand, targets: NDArray[np.float64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(T,) [m] forearms start over the middle of their fingers' targets, or on the way there."""
    home = np.clip(HOME, hand.low, hand.high)
    weight = weights[:, 1:, 1]
    total = weight.sum(axis=1)
    guided = np.flatnonzero(total > 0.0)
    if not len(guided):
        return np.zeros(len(targets))
    offset = targets[:, 1:, 1] - hand.points(home)[1:, 1]
    along = (weight * offset).sum(axis=1)[guided] / total[guided]
    guess: NDArray[np.float64] = np.interp(np.arange(len(targets)), guided, along)
    return guess


def _acceleration_weights(config: PathConfig) -> NDArray[np.float64]:
    scale = np.full(LAYOUT.hand_joints, config.joint_acceleration)
    scale[:3] = config.slide_acceleration
    weights: NDArray[np.float64] = (scale * FRAME_SECONDS**2) ** -2
    return weights


def _step(
    blocks: NDArray[np.float64],
    gradient: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    path: NDArray[np.float64],
    start: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The Gauss-Newton step (T, 27): frames are tied together by their second differences.

    Each joint's second differences tie it to itself two frames away, so that the matrix has a
    band of 2 x 27 below its diagonal.
    """
    frames = len(path)
    # The hand sets off from rest: before the first frame it is at the start, twice.
    second = np.diff(np.vstack([start, start, path]), n=2, axis=0)
    second = np.vstack([second, np.zeros((2, LAYOUT.hand_joints))])
    gradient = gradient + stiffness * (second[:-2] - 2.0 * second[1:-1] + second[2:])
    band = np.zeros((2 * LAYOUT.hand_joints + 1, frames, LAYOUT.hand_joints))
    for below in range(LAYOUT.hand_joints):
        column = np.arange(LAYOUT.hand_joints - below)
        band[below][:, column] = blocks[:, column + below, column]
    # A frame is part of its own second difference and, but for the last two, of the next two's.
    later, latest = ((np.arange(frames) < frames - lag)[:, None] for lag in (1, 2))
    ties = (1.0 + 4.0 * later + latest, -2.0 * later - 2.0 * latest, 1.0 * latest)
    for lag in range(3):
        band[lag * LAYOUT.hand_joints] += ties[lag] * stiffness
    step: NDArray[np.float64] = solveh_banded(
        band.reshape(2 * LAYOUT.hand_joints + 1, -1),
        -gradient.ravel(),
        lower=True,
        overwrite_ab=True,
        check_finite=False,
    )
    return step.reshape(frames, LAYOUT.hand_joints)
