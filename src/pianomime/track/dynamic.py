"""The dynamic tracker: smooth inverse kinematics, inverse dynamics and a press force.

Position actuators are slow: the forearm takes a quarter of a second to arrive. So what is sent
is not the wanted joint position but the one whose spring gives the torque that the wanted motion
needs.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS
from pianomime.plan import FingertipPlan
from pianomime.plan.joint_path import (
    KEY_REST,
    PathConfig,
    PathProblem,
    resting_height,
    smooth_path,
)
from pianomime.progress import Steps
from pianomime.track.finger_feedback import lift_joints, reach_joints, shared
from pianomime.validation import finite, whole_numbers, within
from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT, POINT_COUNT
from pianomime.world.model import SIDES
from pianomime.world.parameters import key_centres
from pianomime.world_names import PAPER

_WINDOW = 1000
"""Frames whose torques are in memory for every finger."""

# Errors of the path at which their cost is 1 [m].
_WRIST_TOLERANCE = 0.05  # along the keyboard; the others do not count
_HOVER_TOLERANCE = 0.004
_PRESS_TOLERANCE = np.array([0.004, 0.0015, 0.001])  # along x, y, z


@dataclass(frozen=True)
class DynamicConfig:
    """Settings of the dynamic tracker."""

    path: PathConfig = field(default_factory=PathConfig)
    """Weights of the joint path, and Gauss-Newton steps to it from the home pose."""
    refine: int = 4
    """Gauss-Newton steps to it where the plan has joint positions to begin from."""
    depth: float = 0.018
    """Depth below the top of the resting key at which a pressing fingertip aims [m]."""
    force: float = 5.0
    """Downward force on a pressed key [N]."""
    joint_feedback: float = 0.5
    """Gain of the joint-position feedback."""
    tip_feedback: float = 0.5
    """Gain of the fingertip-position feedback on the finger's own joints."""
    tip_damping: float = 0.03
    """Damping of the fingertip-position feedback [m/rad]."""
    tip_error: float = 0.02
    """Fingertip errors are clipped to this length [m]."""
    astray: float = 0.009
    """A finger further than this beside its key does not press, but is lifted [m]."""
    sunk: float = 0.005
    """An idle fingertip further than this below the tops of the keys is lifted [m]."""
    clear: float = 0.005
    """Height above the keys to which such fingertips are lifted [m]."""

    def __post_init__(self) -> None:
        whole_numbers(self)
        finite(self)
        within("refine", self.refine, 1)


class DynamicTracker:
    """Follows any fingertip plan, a planner's or a human's.

    Args:
        config: its settings; those of `zero-shot-20hz` if None.
        world: name of the world in which it moves hands.
    """

    def __init__(self, config: DynamicConfig | None = None, world: str = PAPER) -> None:
        self.config = config or DynamicConfig()
        self._hands = [Hand(side, world) for side in SIDES]

    def start(self, plan: FingertipPlan) -> DynamicController:
        """A controller with joint paths and the feed-forward controls that follow them."""
        return DynamicController(plan, self.config, self._hands)


class DynamicController:
    """Feed-forward controls of one plan, and feedback of the present errors.

    Args:
        plan: what is followed.
        config: settings.
        hands: (left, right), for kinematics; their pose is not preserved.
    """

    replayable = True

    def __init__(self, plan: FingertipPlan, config: DynamicConfig, hands: list[Hand]) -> None:
        self.plan, self.config = plan, config
        self._hands = hands
        self._paths = []
        self._tips = []
        self._feedforward = np.empty((len(plan), LAYOUT.ctrl_size))
        self._press = []
        guess, solving = plan.joints, config.path
        if guess is not None:
            solving = replace(solving, iterations=config.refine)
        # Beside the path: its points, the torques of the motion and those of the presses.
        steps = Steps("controls", len(SIDES) * (solving.iterations + 3) * len(plan))
        for index, hand in enumerate(self._hands):
            pressing = plan.finger_key[:, index] >= 0
            targets, weights = self._targets(plan.fingertips[:, index], plan.finger_key[:, index])
            clearance = np.full(pressing.shape, np.nan)
            start = np.zeros(LAYOUT.hand_joints)
            problem = PathProblem(hand, start, targets, weights, clearance, solving)
            begin = None if guess is None else guess[:, index]
            path = smooth_path(problem, steps.advance, begin)
            self._paths.append(path)
            self._tips.append(hand.points_along(path)[:, 1:])
            steps.advance(len(plan))
            torque = motion_torque(hand, path)
            steps.advance(len(plan))
            self._press.append(_Press(hand, config.force, path[1:], pressing))
            steps.advance(len(plan))
            middle = (path[1:] + path[:-1]) / 2
            ctrl = middle @ hand.to_ctrl.T + to_actuators(hand, torque) / hand.gain
            self._feedforward[:, hand.actuators] = ctrl

    def aim(self, frame: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Reference fingertips (2, 5, 3) [m] and joints (2, 27) [rad, m] before a frame."""
        return (
            np.array([tips[frame] for tips in self._tips]),
            np.array([path[frame] for path in self._paths]),
        )

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left: feed-forward, and a share of the present errors.

        A finger that is not over its key would press another one or be caught by it: it is lifted
        above the keys until it is over its key. So is an idle finger that has sunk between keys.
        """
        return self._control(frame, world.qpos)[0]

    def controls(
        self, frames: NDArray[np.int64], qpos: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """As `BatchController.controls`: one world after the other."""
        ctrl, points = (
            np.empty((len(frames), LAYOUT.ctrl_size)),
            np.empty((len(frames), 2, POINT_COUNT, 3)),
        )
        for row, frame in enumerate(frames):
            ctrl[row], points[row] = self._control(int(frame), qpos[row])
        return ctrl, points

    def _control(
        self, frame: int, qpos: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The control (46,) and the points (2, 6, 3) of the hands."""
        ctrl: NDArray[np.float64] = self._feedforward[frame].copy()
        points = np.empty((2, POINT_COUNT, 3))
        for index, hand in enumerate(self._hands):
            here = qpos[hand.joints]
            points[index], jacobian = hand.points_and_jacobian(here)
            tips, jacobian = points[index, 1:], jacobian[1:]
            # A finger corrects itself, and only what pressing fingers have in common is left to
            # the forearm: moving it moves all of them.
            jacobian[..., : LAYOUT.arm_joints] = 0.0
            keys = self.plan.finger_key[frame, index]
            error = self._tips[index][frame] - tips
            beside = np.abs(tips[:, 1] - key_centres()[keys, 1]) > self.config.astray
            low = tips[:, 2] < resting_height(tips[:, 0]) - self.config.sunk
            lift = np.where(keys >= 0, beside, low)
            move = self.config.joint_feedback * (self._paths[index][frame] - here)
            limit = self.config.tip_error
            reach = reach_joints(jacobian, error, limit, self.config.tip_damping)
            move += self.config.tip_feedback * reach
            move[LAYOUT.slide] += shared(np.clip(error[keys >= 0, 1], -limit, limit))
            move += lift_joints(jacobian[lift, 2], self.config.depth + self.config.clear)
            press = self._press[index].of(frame, ~lift)
            ctrl[hand.actuators] += hand.to_ctrl @ move + press
        return ctrl, points

    def _targets(
        self, points: NDArray[np.float64], finger_key: NDArray[np.int8]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        targets = points.copy()
        weights = np.zeros_like(points)
        weights[:, 0, 1] = 1 / _WRIST_TOLERANCE
        weights[:, 1:] = 1 / _HOVER_TOLERANCE
        pressing = finger_key >= 0
        targets[:, 1:, 2][pressing] = KEY_REST[finger_key[pressing]] - self.config.depth
        weights[:, 1:][pressing] = 1 / _PRESS_TOLERANCE
        return targets, weights


class _Press:
    """What one hand adds to its controls to press, for the fingers that press alone.

    Few do in any frame: zeros for the others would take five times the memory.

    Args:
        hand: whose fingers press.
        force: with which they press [N].
        path: (T, 27) joint positions [rad, m].
        pressing: (T, 5) whether each finger presses.
    """

    def __init__(
        self,
        hand: Hand,
        force: float,
        path: NDArray[np.float64],
        pressing: NDArray[np.bool_],
    ) -> None:
        self._pressing = pressing
        self._first = np.append(0, np.cumsum(pressing.sum(axis=1)))
        self._rows = np.empty((self._first[-1], LAYOUT.hand_actuators))
        for begin in range(0, len(path), _WINDOW):
            here = slice(begin, min(begin + _WINDOW, len(path)))
            press = force * press_torque(hand, path[here], pressing[here])
            rows = (to_actuators(hand, press) / hand.gain)[pressing[here]]
            self._rows[self._first[here.start] : self._first[here.stop]] = rows

    def of(self, frame: int, fingers: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(23,) Sum over those of some fingers (5,) that press in a frame [rad, m]."""
        rows = self._rows[self._first[frame] : self._first[frame + 1]]
        chosen: NDArray[np.float64] = rows[fingers[self._pressing[frame]]].sum(axis=0)
        return chosen


def motion_torque(
    hand: Hand,
    path: NDArray[np.float64],
    dt: float = FRAME_SECONDS,
    earlier: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """(T, 27) [N m, N] torque that moves a hand along a path (T + 1, 27), without contacts.

    For each control step, of `dt` [s]: at its middle, with the accelerations of its two ends
    averaged. Before its path the hand came from `earlier` (27,), or was at rest.
    """
    middle = (path[1:] + path[:-1]) / 2
    velocity = np.diff(path, axis=0) / dt
    before = np.zeros_like(path[0]) if earlier is None else (path[0] - earlier) / dt
    padded = np.vstack([before, velocity, velocity[-1:]])
    acceleration = (padded[2:] - padded[:-2]) / (2 * dt)
    torque = np.empty_like(middle)
    data = mujoco.MjData(hand.model)
    for step in range(len(middle)):
        data.qpos[:], data.qvel[:] = middle[step], velocity[step]
        data.qacc[:] = acceleration[step]
        mujoco.mj_fwdPosition(hand.model, data)
        mujoco.mj_fwdVelocity(hand.model, data)
        mujoco.mj_rne(hand.model, data, 1, torque[step])
        torque[step] += hand.model.dof_armature * acceleration[step] - data.qfrc_passive
    return torque


def press_torque(
    hand: Hand, path: NDArray[np.float64], pressing: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """(T, 5, 27) [N m, N] torque with which each pressing fingertip (T, 5) pushes down 1 N."""
    torque = np.zeros((*pressing.shape, path.shape[1]))
    busy = pressing.any(axis=1)
    _, jacobian = hand.points_and_jacobians(path[busy])
    torque[busy] = np.where(pressing[busy, :, None], -jacobian[:, 1:, 2], 0.0)
    return torque


def to_actuators(hand: Hand, torque: NDArray[np.float64]) -> NDArray[np.float64]:
    """Forces (T, 23) of the actuators that come nearest joint torques (T, 27)."""
    forces: NDArray[np.float64] = torque @ np.linalg.pinv(hand.to_ctrl)
    return forces
