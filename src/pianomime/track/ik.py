"""The paper's tracker: one step of inverse kinematics a frame (appendix B, table 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.plan import FingertipPlan
from pianomime.world import World
from pianomime.world.hand import SIDES, Hand


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


class IkTracker:
    """Sends the joint positions that one Gauss-Newton step takes toward the fingertip targets.

    The step minimises `sum_i |W_i (J_i dq - e_i)|^2 + damping |dq|^2` within the joint limits.
    """

    def __init__(self, config: IkConfig | None = None) -> None:
        self.config = config or IkConfig()
        self._hands = [Hand(side) for side in SIDES]
        self._targets = np.empty((0, 2, 6, 3))
        tips = np.full((5, 3), self.config.tip_weight)
        self._weights = np.vstack([self.config.wrist_weight, tips])

    def begin(self, plan: FingertipPlan) -> None:
        """Take the plan's fingertip targets."""
        self._targets = plan.fingertips

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left: where one step from the present pose leads [rad, m]."""
        ctrl = np.empty(world.model.nu)
        qpos = world.qpos
        for hand, target in zip(self._hands, self._targets[frame], strict=True):
            ctrl[hand.actuators] = hand.to_ctrl @ self.step(hand, qpos[hand.joints], target)
        return ctrl

    def step(
        self, hand: Hand, qpos: NDArray[np.float64], target: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Joint positions (27,) one step from `qpos` toward the targets (6, 3) of the points."""
        points, jacobian = hand.points_and_jacobian(qpos)
        error = (self._weights * (target - points)).ravel()
        jacobian = (self._weights[..., None] * jacobian).reshape(error.size, -1)
        # Every point task adds its own damping, proportional to its own squared error.
        damping = self.config.damping + self.config.lm_damping * float(error @ error)
        return qpos + bounded_least_squares(
            jacobian, error, damping, hand.low - qpos, hand.high - qpos
        )


def bounded_least_squares(
    jacobian: NDArray[np.float64],
    error: NDArray[np.float64],
    damping: float,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The x in [low, high] that minimises `|jacobian x - error|^2 + damping |x|^2`.

    A box with low <= high is never empty, so there always is an answer: where the fast solver
    gives up on a badly conditioned program, a slower one that cannot does it.
    """
    import daqp

    hessian = jacobian.T @ jacobian
    hessian[np.diag_indices_from(hessian)] += damping
    gradient = -jacobian.T @ error
    # Brought to unit diagonal: weights from 1e-12 to 1e4 make it ill conditioned as it stands.
    scale = 1.0 / np.sqrt(hessian.diagonal())
    solution, _, status, _ = daqp.solve(
        hessian * np.outer(scale, scale),
        gradient * scale,
        np.empty((0, len(low))),
        high / scale,
        low / scale,
        np.zeros(len(low), np.int32),
    )
    if status == 1:
        within: NDArray[np.float64] = np.clip(solution * scale, low, high)
        return within
    from scipy.optimize import lsq_linear

    rows = np.vstack([jacobian, np.sqrt(damping) * np.eye(len(low))])
    # lsq_linear wants a box with an inside.
    result = lsq_linear(rows, np.r_[error, np.zeros(len(low))], (low, np.maximum(high, low + 1e-9)))
    inside: NDArray[np.float64] = np.clip(result.x, low, high)
    return inside
