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
        bodies = self.model.site_bodyid[self._sites]
        self._root = int(self.model.body_rootid[bodies[0]])
        self._fixed = ~np.array([self._moves(int(body)) for body in bodies])

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

    def points_along(self, path: NDArray[np.floating]) -> NDArray[np.float64]:
        """The points, as `points` returns them, in many poses.

        Args:
            path: (T, 27) joint positions [rad, m].

        Returns:
            (T, 6, 3) wrist, then fingertips, thumb first [m].
        """
        qpos, sites = self.data.qpos, self.data.site_xpos
        points = np.empty((len(path), *sites.shape))
        for row, pose in enumerate(path):
            qpos[:] = pose
            mujoco.mj_kinematics(self.model, self.data)
            points[row] = sites
        return points[:, self._sites]

    def points_and_jacobians(
        self, path: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The points and their Jacobians, bit for bit as `points_and_jacobian`, in many poses.

        Args:
            path: (T, 27) joint positions [rad, m].

        Returns:
            (T, 6, 3) points [m] and (T, 6, 3, 27) Jacobians [m/rad, 1].
        """
        data = self.data
        points = np.empty((len(path), *data.site_xpos.shape))
        axes = np.empty((len(path), *data.cdof.shape))
        centre = np.empty((len(path), 3))
        # Asked for once: MuJoCo makes a new array of its numbers each time.
        qpos, sites, motion, masses = data.qpos, data.site_xpos, data.cdof, data.subtree_com
        for row, pose in enumerate(path):
            qpos[:] = pose
            mujoco.mj_kinematics(self.model, data)
            mujoco.mj_comPos(self.model, data)
            points[row], axes[row], centre[row] = sites, motion, masses[self._root]
        points = points[:, self._sites]
        # MuJoCo gives the motion about each joint as a turn, and a velocity at the hand's centre of
        # mass; what `mj_jacSite` computes of them for one frame is computed for all.
        arm = (points - centre[:, None])[..., None]
        turn, slide = axes[:, None, :, :3], axes[:, None, :, 3:]
        jacobian = np.empty((*points.shape, LAYOUT.hand_joints))
        for axis in range(3):
            one, other = (axis + 1) % 3, (axis + 2) % 3
            across = turn[..., one] * arm[:, :, other] - turn[..., other] * arm[:, :, one]
            np.add(slide[..., axis], across, out=jacobian[:, :, axis])
        jacobian.swapaxes(2, 3)[:, self._fixed] = 0.0
        return points, jacobian

    def _moves(self, body: int) -> NDArray[np.bool_]:
        """(27,) Which joints move a body."""
        moves = np.zeros(LAYOUT.hand_joints, bool)
        while body:
            first, count = self.model.body_jntadr[body], self.model.body_jntnum[body]
            moves[first : first + count] = True
            body = int(self.model.body_parentid[body])
        return moves

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
        points[:, index] = hand.points_along(joints[:, LAYOUT.among_hands(index)])
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
