"""Trajectory optimisation: a smooth joint path that takes the fingertips through their targets.

One damped Gauss-Newton problem over all frames of a piece: squared tracking errors and squared
accelerations are minimised together. A hand therefore starts moving before a leap, and fingers
that do not play stay out of the way. Each step is one banded Cholesky solve, so the time grows
linearly with the length of the piece. So does the memory, but only by the lower triangle of one
27 x 27 block a frame: 220 MB for an hour.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, FRAME_SECONDS
from pianomime.plan.band_solve import solve_in_windows
from pianomime.progress import ignore
from pianomime.short_repr import short_repr
from pianomime.validation import above_zero, whole_numbers, within
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres, key_half_sizes

_HOME_POSE = {
    "forearm_tz": -0.01,
    "WRJ2": -0.1,
    "WRJ1": -0.05,
    **{"FFJ3": 0.83, "FFJ2": 0.65, "FFJ1": 0.65},
    **{"MFJ3": 0.79, "MFJ2": 0.61, "MFJ1": 0.61},
    **{"RFJ3": 0.76, "RFJ2": 0.57, "RFJ1": 0.57},
    **{"LFJ5": 0.05, "LFJ3": 0.74, "LFJ2": 0.55, "LFJ1": 0.55},
    **{"THJ5": 0.13, "THJ4": 0.84, "THJ1": 0.2},
}
"""Joint positions that are not 0 with the fingers curved over the keys [rad, m]."""
HOME: NDArray[np.float64] = np.array([_HOME_POSE.get(name, 0.0) for name in LAYOUT.joint_names])
"""(27,) Home pose of either hand, the fingers curved over the keys [rad, m]."""

TIP_RADIUS = 0.0085
"""[m] Distance from a fingertip's site to the surface that touches a key."""
WHITE_REST, BLACK_REST = (
    float(key_centres()[key, 2] + key_half_sizes()[key, 2]) + TIP_RADIUS for key in (0, 1)
)
"""[m] Height of a fingertip's site when the finger rests on a white or on a black key."""
KEY_REST = np.where(BLACK, BLACK_REST, WHITE_REST)
"""(88,) [m] Height of a fingertip's site when the finger rests on each key."""

_HELD = 1e9
"""Stiffness that keeps a joint at its limit during one step."""

_WINDOW = 1000
"""Frames whose matrices are in memory as a whole; excerpts of less than 50 s fit in one window."""
_SOLVED = 4000
"""Frames that are solved at once; what does not fit is factored twice, see `band_solve`."""
_TRIANGLE = [
    np.arange(LAYOUT.hand_joints - below) * (LAYOUT.hand_joints + 1) + below * LAYOUT.hand_joints
    for below in range(LAYOUT.hand_joints)
]
"""Places of the diagonal of a 27 x 27 block, and of each line below it, in the flat block."""
_STORED = np.concatenate(_TRIANGLE)
"""(378,) What is stored of a block, which is symmetric."""
_LINES = np.split(np.arange(len(_STORED)), np.cumsum([len(line) for line in _TRIANGLE])[:-1])
"""Places of the same lines in what is stored."""
_BANDS = 2 * LAYOUT.hand_joints
"""Bands below the diagonal of the matrix of a step."""


@dataclass(frozen=True)
class PathConfig:
    """Weights of the terms of the path: the deviation at which each term's cost is 1."""

    slide_acceleration: float = 40.0
    """Acceleration of the forearm's slides [m/s^2]."""
    joint_acceleration: float = 400.0
    """Acceleration of the joints of wrist and fingers [rad/s^2]."""
    posture: float = 3.0
    """Deviation of a joint from the home pose [rad]."""
    slide_posture: float = 0.1
    """Displacement of the forearm toward the piano and upward from the home pose [m]."""
    coupling: float = 0.15
    """Difference between the two coupled end joints of a finger [rad]."""
    floor: float = 0.002
    """Depth of an idle fingertip below its clearance above the keys [m]."""
    damping: float = 0.3
    """Displacement of a joint in one Gauss-Newton step [rad, m]."""
    step: float = 0.4
    """Largest displacement of a joint in one Gauss-Newton step [rad, m]."""
    iterations: int = 10
    """Number of Gauss-Newton steps."""
    apart: float = 0.0
    """Distance that fingers, and hands, keep from each other [m]; 0 where they pass through each
    other, as in the paper's world."""
    near: float = 0.003
    """Shortfall of that distance [m]."""

    def __post_init__(self) -> None:
        whole_numbers(self)
        for name, value in vars(self).items():
            if name == "apart":
                within(name, value, 0.0)
            else:
                above_zero(name, value)


class Rows(NamedTuple):
    """C more residuals of the path of a hand, whose squares are to be small.

    Attributes:
        frame: (C,) in which each counts; in order.
        residual: (C,) its value there.
        gradient: (C, 27) by the joints [1/rad, 1/m].
    """

    frame: NDArray[np.int64]
    residual: NDArray[np.float64]
    gradient: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PathProblem:
    """What the path of one hand over T frames is to be.

    Attributes:
        hand: the hand that moves.
        start: (27,) joint positions before the first frame [rad, m].
        targets: (T, 6, 3) target positions of wrist and fingertips at the end of each frame,
            world frame [m].
        weights: (T, 6, 3) weight of each coordinate's error, 0 for none [1/m].
        clearance: (T, 5) least height of each fingertip above the keys [m]; NaN for fingers
            that may go down.
        config: weights of the other terms.
        dt: length of a frame [s]. Tracking errors are as given; all other terms count for the time
            that they last, so that a path of shorter frames is the same path.
        earlier: (27,) joint positions a frame before `start` [rad, m]; None where the hand is at
            rest there.
    """

    hand: Hand
    start: NDArray[np.float64]
    targets: NDArray[np.float64]
    weights: NDArray[np.float64]
    clearance: NDArray[np.float64]
    config: PathConfig = field(default_factory=PathConfig)
    dt: float = FRAME_SECONDS
    earlier: NDArray[np.float64] | None = None

    __repr__ = short_repr

    @property
    def lasts(self) -> float:
        """Length of a frame, as a share of 0.05 s."""
        return self.dt / FRAME_SECONDS

    def part(self, first: int, stop: int, before: NDArray[np.float64]) -> PathProblem:
        """The problem of some of the frames, from where the hand then is.

        Args:
            first: frame with which they begin.
            stop: frame before which they end.
            before: (2, 27) joint positions a frame before, and at the beginning [rad, m].
        """
        here = slice(first, stop)
        return replace(
            self,
            start=before[1],
            targets=self.targets[here],
            weights=self.weights[here],
            clearance=self.clearance[here],
            earlier=before[0],
        )

    def begin(self, guess: NDArray[np.float64] | None) -> NDArray[np.float64]:
        """(T, 27) A path to begin with [rad, m].

        Args:
            guess: (T, 27) such a path; None for the home pose along the targets.
        """
        hand = self.hand
        if guess is not None:
            return np.clip(guess, hand.low, hand.high)
        path = np.tile(np.clip(HOME, hand.low, hand.high), (len(self.targets), 1))
        path[:, LAYOUT.slide] = _slide_guess(hand, self.targets, self.weights)
        return path

    def improve(
        self,
        path: NDArray[np.float64],
        rows: Rows | None = None,
        advance: Callable[[int], None] = ignore,
    ) -> NDArray[np.float64]:
        """(T, 27) The path after one Gauss-Newton step [rad, m].

        Args:
            path: (T, 27) before it.
            rows: residuals that count in addition.
            advance: called with a number of frames as they are done, T in all.
        """
        hand, config, frames = self.hand, self.config, len(path)
        posture = _posture_weights(config) * self.lasts
        coupling = _coupling_hessian(config) * self.lasts
        stiffness = _acceleration_weights(config, self.dt) * self.lasts
        home = np.clip(HOME, hand.low, hand.high)
        everywhere = np.diag(posture + config.damping**-2 * self.lasts) + coupling
        blocks = np.empty((frames, len(_STORED)))
        gradient = np.empty((frames, LAYOUT.hand_joints))
        for first in range(0, frames, _WINDOW):
            here = slice(first, min(first + _WINDOW, frames))
            whole, gradient[here] = _tracking_terms(
                hand,
                path[here],
                self.targets[here],
                self.weights[here],
                self.clearance[here],
                config,
            )
            whole += everywhere
            blocks[here] = whole.reshape(len(whole), -1)[:, _STORED]
            advance(len(whole))
        gradient += posture * (path - home) + path @ coupling
        if rows is not None:
            edges = np.flatnonzero(np.diff(rows.frame, prepend=-1, append=-1))
            for begin, end in pairwise(edges):
                frame, more = rows.frame[begin], rows.gradient[begin:end]
                blocks[frame] += (more.T @ more).ravel()[_STORED]
                gradient[frame] += rows.residual[begin:end] @ more
        # A joint that is pushed against its limit stays there for this step.
        held = ((path <= hand.low) & (gradient > 0)) | ((path >= hand.high) & (gradient < 0))
        blocks[:, _LINES[0]] += held * _HELD
        earlier = self.start if self.earlier is None else self.earlier
        step = _step(blocks, gradient, stiffness, path, np.stack([earlier, self.start]))
        return np.clip(path + np.clip(step, -config.step, config.step), hand.low, hand.high)


def smooth_path(
    problem: PathProblem,
    advance: Callable[[int], None] = ignore,
    guess: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Optimise the joint positions of one hand at the end of each of T frames.

    Args:
        problem: the hand, and where it is to go.
        advance: called with a number of frames as they are done, `iterations` times T in all.
        guess: (T, 27) path to begin with [rad, m]; None for the home pose along the targets.

    Returns:
        (T + 1, 27) joint positions [rad, m]; the first row is where the hand starts.
    """
    path = problem.begin(guess)
    for _ in range(problem.config.iterations):
        path = problem.improve(path, advance=advance)
    return np.vstack([problem.start, path])


def _tracking_terms(
    hand: Hand,
    path: NDArray[np.float64],
    targets: NDArray[np.float64],
    weights: NDArray[np.float64],
    clearance: NDArray[np.float64],
    config: PathConfig,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Hessian (T, 27, 27) and gradient (T, 27) of the squared errors of the points of a hand."""
    points, jacobian = hand.points_and_jacobians(path)
    error = (points - targets) * weights
    rows = jacobian * weights[..., None]
    height = points[:, 1:, 2] - clearance - resting_height(points[:, 1:, 0])
    below = height < 0.0
    error[:, 1:, 2][below] = height[below] / config.floor
    rows[:, 1:, 2][below] = jacobian[:, 1:, 2][below] / config.floor
    rows = rows.reshape(len(path), -1, LAYOUT.hand_joints)
    error = error.reshape(len(path), -1)
    columns = rows.swapaxes(1, 2)
    return columns @ rows, (columns @ error[..., None])[..., 0]


def resting_height(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height of a fingertip's site when the finger rests on the keys at `x`.

    It blends from white to black keys where a fingertip begins to reach over the black ones.

    Args:
        x: world x of fingertips, any shape [m].

    Returns:
        World z, of the same shape [m].
    """
    onto_black = np.clip((0.03 - x) / 0.01, 0.0, 1.0)
    return WHITE_REST + (BLACK_REST - WHITE_REST) * onto_black


def _posture_weights(config: PathConfig) -> NDArray[np.float64]:
    weights = np.full(LAYOUT.hand_joints, config.posture**-2)
    weights[LAYOUT.slides] = config.slide_posture**-2
    weights[LAYOUT.slide] = 0.0
    return weights


def _coupling_hessian(config: PathConfig) -> NDArray[np.float64]:
    hessian = np.zeros((LAYOUT.hand_joints, LAYOUT.hand_joints))
    # The end joints of a finger share a tendon and turn together when nothing touches them.
    for one, other in LAYOUT.coupled:
        pair = np.ix_([one, other], [one, other])
        hessian[pair] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / config.coupling**2
    return hessian


def _slide_guess(
    hand: Hand, targets: NDArray[np.float64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(T,) First guess of the slide along the keyboard [m].

    It puts the hand over the weighted mean of its fingers' targets, and interpolates between
    frames that have any.
    """
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


def _acceleration_weights(config: PathConfig, dt: float) -> NDArray[np.float64]:
    """(27,) Weight of each joint's squared second difference between frames."""
    acceleration = np.full(LAYOUT.hand_joints, config.joint_acceleration)
    acceleration[LAYOUT.slides] = config.slide_acceleration
    weights: NDArray[np.float64] = (acceleration * dt**2) ** -2
    return weights


def _step(
    blocks: NDArray[np.float64],
    gradient: NDArray[np.float64],
    stiffness: NDArray[np.float64],
    path: NDArray[np.float64],
    before: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(T, 27) The Gauss-Newton step [rad, m].

    Second differences couple each joint with itself up to two frames away, so the matrix has
    2 x 27 bands below its diagonal.

    Args:
        blocks: (T, 378) the lower triangles of the blocks on its diagonal, as in `_STORED`, without
            the second differences.
        gradient: (T, 27) likewise.
        stiffness: (27,) weight of the second differences.
        path: (T, 27) where the step begins [rad, m].
        before: (2, 27) the two positions before that path [rad, m].
    """
    frames = len(path)
    second = np.diff(np.vstack([before, path]), n=2, axis=0)
    second = np.vstack([second, np.zeros((2, LAYOUT.hand_joints))])
    gradient = gradient + stiffness * (second[:-2] - 2.0 * second[1:-1] + second[2:])

    def columns(first: int, stop: int) -> NDArray[np.float64]:
        here = np.arange(first // LAYOUT.hand_joints, stop // LAYOUT.hand_joints)
        band = np.zeros((len(here), LAYOUT.hand_joints, _BANDS + 1))
        for below, line in enumerate(_LINES):
            band[:, : len(line), below] = blocks[here[0] : here[-1] + 1, line[0] : line[-1] + 1]
        # A frame is in its own second difference and, except the last two, in those of the next
        # two.
        later, latest = ((here < frames - lag)[:, None] for lag in (1, 2))
        ties = (1.0 + 4.0 * later + latest, -2.0 * later - 2.0 * latest, 1.0 * latest)
        for lag in range(3):
            band[:, :, lag * LAYOUT.hand_joints] += ties[lag] * stiffness
        return band.reshape(-1, _BANDS + 1)

    step = solve_in_windows(columns, -gradient.ravel(), _BANDS, _SOLVED * LAYOUT.hand_joints)
    return step.reshape(frames, LAYOUT.hand_joints)
