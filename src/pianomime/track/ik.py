"""The paper's tracker: one step of inverse kinematics a frame (appendix B, table 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pianomime.plan import FingertipPlan
from pianomime.validation import finite
from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.layout import FINGER_COUNT, LAYOUT, POINT_COUNT
from pianomime.world.model import SIDES


@dataclass(frozen=True)
class IkConfig:
    """Weights of the quadratic program, as published."""

    tip_weight: float = 1e4
    """Weight of each fingertip's position error."""
    wrist_weight: tuple[float, float, float] = (1e-8, 10.0, 1e-12)
    """Weight of the wrist's error along x, y, z: it hardly counts but along the keyboard."""
    damping: float = 1e-6
    """Weight of the joint displacements."""
    lm_damping: float = 1e-6
    """Levenberg-Marquardt damping, as a factor of the weighted squared error."""

    def __post_init__(self) -> None:
        finite(self)


class IkTracker:
    """Sends the joint positions that one Gauss-Newton step takes toward the fingertip targets.

    The step minimises `sum_i |W_i (J_i dq - e_i)|^2 + damping |dq|^2` within the joint limits.

    Args:
        config: weights of the quadratic program; the paper's if None.
    """

    def __init__(self, config: IkConfig | None = None) -> None:
        self.config = config or IkConfig()
        self._hands = [Hand(side) for side in SIDES]
        self._low, self._high = (
            np.array([getattr(hand, end) for hand in self._hands]) for end in ("low", "high")
        )
        tips = np.full((FINGER_COUNT, 3), self.config.tip_weight)
        self._weights = np.vstack([self.config.wrist_weight, tips])

    def start(self, plan: FingertipPlan) -> IkController:
        """A controller that steps toward the plan's fingertips."""
        return IkController(plan, self)

    def solve(
        self, qpos: NDArray[np.float64], targets: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """One step of n worlds and both hands, in one pass over arrays.

        Args:
            qpos: (n, 142) positions, as in `World.qpos` [rad, m].
            targets: (n, 2, 6, 3) where wrists and fingertips should be [m].

        Returns:
            The controls (n, 46) [rad, m] and the points (n, 2, 6, 3) [m] at `qpos`.
        """
        here = np.stack([qpos[:, hand.joints] for hand in self._hands], axis=1)
        points = np.empty((*here.shape[:2], POINT_COUNT, 3))
        jacobian = np.empty((*points.shape, here.shape[2]))
        for index, hand in enumerate(self._hands):
            for row in range(len(here)):
                points[row, index], jacobian[row, index] = hand.points_and_jacobian(
                    here[row, index]
                )
        there = self._steps(here, points, jacobian, targets, self._low, self._high)
        ctrl = np.empty((len(here), LAYOUT.ctrl_size))
        for index, hand in enumerate(self._hands):
            ctrl[:, hand.actuators] = (hand.to_ctrl @ there[:, index, :, None])[..., 0]
        return ctrl, points

    def step(
        self, hand: Hand, qpos: NDArray[np.float64], target: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Joint positions (27,) one step from `qpos` toward the targets (6, 3) of the points."""
        points, jacobian = hand.points_and_jacobian(qpos)
        return self._steps(qpos, points, jacobian, target, hand.low, hand.high)

    def _steps(
        self,
        qpos: NDArray[np.float64],
        points: NDArray[np.float64],
        jacobian: NDArray[np.float64],
        targets: NDArray[np.float64],
        low: NDArray[np.float64],
        high: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """(..., 27) one step on; of points (..., 6, 3) and their Jacobians (..., 6, 3, 27)."""
        error = (self._weights * (targets - points)).reshape(*points.shape[:-2], -1)
        weighted = (self._weights[..., None] * jacobian).reshape(*error.shape, -1)
        square = (error[..., None, :] @ error[..., None])[..., 0, 0]
        # Every point task adds its own damping, proportional to its own squared error.
        damping = self.config.damping + self.config.lm_damping * square
        return qpos + bounded_least_squares(weighted, error, damping, low - qpos, high - qpos)


@dataclass(frozen=True, eq=False)
class IkController:
    """One step of inverse kinematics in every frame.

    Attributes:
        plan: what is followed.
        tracker: whose step it is.
    """

    plan: FingertipPlan
    tracker: IkTracker
    replayable: ClassVar[bool] = True

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left: where one step from the present pose leads [rad, m]."""
        ctrl: NDArray[np.float64] = self.controls(np.array([frame]), world.qpos[None])[0][0]
        return ctrl

    def controls(
        self, frames: NDArray[np.int64], qpos: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """As `BatchController.controls`."""
        return self.tracker.solve(qpos, self.plan.fingertips[frames])


def bounded_least_squares(
    jacobian: NDArray[np.float64],
    error: NDArray[np.float64],
    damping: NDArray[np.float64] | float,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The x in [low, high] that minimises `|jacobian x - error|^2 + damping |x|^2`.

    Many such programs are prepared together, and are each, bit for bit, what one alone is. A box
    with low <= high is never empty, so there always is an answer: where the fast solver gives up
    on a badly conditioned program, a slower one that cannot does it.

    Args:
        jacobian: (..., R, J).
        error: (..., R).
        damping: (...), or one for all.
        low: (..., J).
        high: (..., J).

    Returns:
        (..., J).
    """
    import daqp

    transposed = jacobian.swapaxes(-1, -2)
    hessian = transposed @ jacobian
    diagonal = np.einsum("...ii->...i", hessian)  # a view
    diagonal += np.asarray(damping)[..., None]
    # Brought to unit diagonal: weights from 1e-12 to 1e4 make it ill conditioned as it stands.
    scale = 1.0 / np.sqrt(diagonal)
    hessian *= scale[..., :, None] * scale[..., None, :]
    gradient = (-transposed @ error[..., None])[..., 0] * scale
    most, least = high / scale, low / scale
    x = np.empty_like(scale)
    none = np.empty((0, x.shape[-1]))
    for index in np.ndindex(x.shape[:-1]):
        solution, _, status, _ = daqp.solve(
            hessian[index],
            gradient[index],
            none,
            most[index],
            least[index],
            np.zeros(x.shape[-1], np.int32),
        )
        if status == 1:
            x[index] = solution * scale[index]
            continue
        ridge = float(np.broadcast_to(damping, x.shape[:-1])[index])
        x[index] = _slow_least_squares(
            jacobian[index], error[index], ridge, low[index], high[index]
        )
    within: NDArray[np.float64] = np.clip(x, low, high)
    return within


def _slow_least_squares(
    jacobian: NDArray[np.float64],
    error: NDArray[np.float64],
    damping: float,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> NDArray[np.float64]:
    from scipy.optimize import lsq_linear

    rows = np.vstack([jacobian, np.sqrt(damping) * np.eye(len(low))])
    # lsq_linear wants a box with an inside.
    result = lsq_linear(rows, np.r_[error, np.zeros(len(low))], (low, np.maximum(high, low + 1e-9)))
    x: NDArray[np.float64] = result.x
    return x
