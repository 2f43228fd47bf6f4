"""Kinematics and dynamics of one hand without the piano, for planners and trackers."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from pianomime.world.layout import LAYOUT, POINT_COUNT
from pianomime.world.model import SIDES, Side, fingertip_sites, hand_model
from pianomime.world_names import PAPER


class Hand:
    """The kinematics of one hand.

    Args:
        side: "lh" or "rh".
        world: name of the world that the hand is of.

    Attributes:
        side: "lh" or "rh".
        world: name of the world that it is of.
        model: MuJoCo model of the hand alone; read-only.
        data: its MuJoCo state, in the pose that was last asked for.
        low, high: (27,) joint limits [rad, m].
        ctrl_low, ctrl_high: (23,) ranges of the actuators [rad, m].
        gain: (23,) stiffness of the position actuators [N m/rad, N/m].
        to_ctrl: (23, 27) matrix from joint positions to actuator lengths, which is also that from
            joint targets to controls; the two end joints of a finger share a tendon.
        joints: slice of this hand's joints in the positions (142,) of a World.
        actuators: slice of this hand's actuators in the controls (46,) of a World.
    """

    def __init__(self, side: Side, world: str = PAPER) -> None:
        self.side, self.world = side, world
        self.model = hand_model(side, world)
        self.data = mujoco.MjData(self.model)
        self.low, self.high = self.model.jnt_range.T.copy()
        self.ctrl_low, self.ctrl_high = self.model.actuator_ctrlrange.T.copy()
        self.gain: NDArray[np.float64] = self.model.actuator_gainprm[:, 0].copy()
        self.to_ctrl = self._transmission()
        self.joints = LAYOUT.joints[SIDES.index(side)]
        self.actuators = LAYOUT.actuators[SIDES.index(side)]
        self._sites = [self.model.site(name).id for name in fingertip_sites(side)]

    def points(self, qpos: NDArray[np.float64]) -> NDArray[np.float64]:
        """World positions of wrist and fingertips.

        Args:
            qpos: (27,) joint positions [rad, m].

        Returns:
            (6, 3) wrist, then fingertips, thumb first [m].
        """
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)
        points: NDArray[np.float64] = self.data.site_xpos[self._sites]
        return points

    def points_and_jacobian(
        self, qpos: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The points, as `points` returns them, and their Jacobian.

        Args:
            qpos: (27,) joint positions [rad, m].

        Returns:
            (6, 3) points [m] and (6, 3, 27) Jacobian [m/rad, 1].
        """
        points = self.points(qpos)
        mujoco.mj_comPos(self.model, self.data)
        jacobian = np.empty((len(self._sites), 3, LAYOUT.hand_joints))
        for row, site in enumerate(self._sites):
            mujoco.mj_jacSite(self.model, self.data, jacobian[row], None, site)
        return points, jacobian

    def _transmission(self) -> NDArray[np.float64]:
        mujoco.mj_forward(self.model, self.data)
        moment = np.zeros((LAYOUT.hand_actuators, LAYOUT.hand_joints))
        mujoco.mju_sparse2dense(
            moment,
            self.data.actuator_moment.reshape(-1),
            self.data.moment_rownnz,
            self.data.moment_rowadr,
            self.data.moment_colind.reshape(-1),
        )
        return moment


@cache
def both_hands() -> tuple[Hand, Hand]:
    """Shared hands (left, right), for reading constants only: their pose is not preserved."""
    left, right = SIDES
    return Hand(left), Hand(right)


def hand_points(joints: NDArray[np.floating]) -> NDArray[np.float64]:
    """World positions of wrists and fingertips of both hands.

    Args:
        joints: (B, 54) joint positions, right hand then left hand [rad, m].

    Returns:
        (B, 2, 6, 3) hands (left, right), points wrist, thumb .. little [m].
    """
    points = np.empty((len(joints), 2, POINT_COUNT, 3))
    for index, hand in enumerate(both_hands()):
        for row, pose in enumerate(joints[:, LAYOUT.among_hands(index)]):
            points[row, index] = hand.points(pose)
    return points


def by_actuator(finger: float, wrist: float, slide: float) -> NDArray[np.float64]:
    """(46,) A value for each actuator, by the part that it moves.

    Args:
        finger: value of the actuators of all finger joints.
        wrist: value of those of the wrists.
        slide: value of those of the forearms' slides.
    """
    one = np.full(LAYOUT.hand_actuators, finger)
    one[LAYOUT.wrist_actuators], one[LAYOUT.slide_actuators] = wrist, slide
    return np.tile(one, 2)
