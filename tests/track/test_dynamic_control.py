"""The dynamic controller, part by part: what each gain adds to the control, by hand."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime import Score
from pianomime.keyboard import FRAME_SECONDS
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.plan.joint_path import KEY_REST, resting_height
from pianomime.track import DynamicConfig, DynamicTracker
from pianomime.track.dynamic import DynamicController
from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES
from pianomime.world.parameters import key_centres

HANDS = [Hand(side) for side in SIDES]
NEVER = 1e3
FRAME = 9
NOTHING = {
    "joint_feedback": 0.0,
    "tip_feedback": 0.0,
    "force": 0.0,
    "astray": NEVER,
    "sunk": NEVER,
    "tip_error": 0.0,
}
"""Settings that leave nothing but the feed-forward control."""


@pytest.fixture(scope="module")
def plan() -> FingertipPlan:
    """A chord of both hands: two fingers of the left and three of the right press in FRAME."""
    key = np.array([27, 34, 51, 55, 58])
    return ZeroShotPlanner().plan(Score(key, np.full(5, 0.3), np.full(5, 0.7), np.full(5, 64)))


def start(plan: FingertipPlan, **settings: float) -> DynamicController:
    return DynamicTracker(DynamicConfig(**{**NOTHING, **settings})).start(plan)


def state(controller: DynamicController, off: NDArray[np.float64] | float = 0.0) -> World:
    """A World with both hands where they should be before FRAME, and joints off by so much."""
    world = World()
    _, path = controller.aim(FRAME)
    for index in range(2):
        world.data.qpos[LAYOUT.joints[index]] = path[index] + off
    return world


def added(plan: FingertipPlan, off: NDArray[np.float64] | float, **settings: float) -> NDArray:
    """(2, 23) what settings add to the feed-forward control, for (left, right)."""
    with_it, without = start(plan, **settings), start(plan)
    world = state(with_it, off)
    difference = with_it.control(FRAME, world) - without.control(FRAME, world)
    return np.array([difference[part] for part in LAYOUT.actuators])


def some_offsets(size: float) -> NDArray[np.float64]:
    return np.random.default_rng(0).normal(0.0, size, LAYOUT.hand_joints)


def test_feedforward_is_the_pose_whose_springs_give_the_torque(plan: FingertipPlan) -> None:
    controller = start(plan)
    paths = np.array([controller.aim(frame)[1] for frame in range(FRAME - 1, FRAME + 3)])
    ctrl = controller.control(FRAME, state(controller, some_offsets(0.1)))
    for index, hand in enumerate(HANDS):
        model = copy.copy(hand.model)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        data = mujoco.MjData(model)
        velocity = np.diff(paths[:, index], axis=0) / FRAME_SECONDS
        data.qpos[:] = (paths[1, index] + paths[2, index]) / 2
        data.qvel[:] = velocity[1]
        data.qacc[:] = (velocity[2] - velocity[0]) / (2 * FRAME_SECONDS)
        mujoco.mj_inverse(model, data)
        torque = np.linalg.lstsq(hand.to_ctrl.T, data.qfrc_inverse, rcond=None)[0]
        wanted = hand.to_ctrl @ data.qpos + torque / hand.gain
        np.testing.assert_allclose(ctrl[hand.actuators], wanted, atol=1e-9)


def test_joint_feedback_is_a_share_of_the_error(plan: FingertipPlan) -> None:
    off = some_offsets(0.05)
    found = added(plan, off, joint_feedback=0.5)
    for index, hand in enumerate(HANDS):
        np.testing.assert_allclose(found[index], hand.to_ctrl @ (-0.5 * off), atol=1e-12)


@pytest.mark.parametrize("longest", [NEVER, 0.003])
def test_fingertip_feedback_is_damped_least_squares(plan: FingertipPlan, longest: float) -> None:
    """Of each finger by its own joints; errors are shortened to their greatest length."""
    off = some_offsets(0.05)
    gain, damping = 0.4, 0.03
    # Only the slide is left to the shared error, which the next test is of.
    found = added(plan, off, tip_feedback=gain, tip_damping=damping, tip_error=longest)
    none = added(plan, off, tip_feedback=0.0, tip_error=longest)
    controller = start(plan)
    tips, path = controller.aim(FRAME)
    for index, hand in enumerate(HANDS):
        points, jacobian = hand.points_and_jacobian(path[index] + off)
        move = np.zeros(LAYOUT.hand_joints)
        for finger, joints in enumerate(LAYOUT.finger_joints):
            error = tips[index, finger] - points[1 + finger]
            error *= min(1.0, longest / np.linalg.norm(error))
            mine = jacobian[1 + finger][:, joints]
            rows = np.vstack([mine, damping * np.eye(mine.shape[1])])
            wanted = np.concatenate([error, np.zeros(mine.shape[1])])
            move[joints] += gain * np.linalg.lstsq(rows, wanted, rcond=None)[0]
        np.testing.assert_allclose(found[index] - none[index], hand.to_ctrl @ move, atol=1e-9)


def test_the_forearm_takes_what_pressing_fingers_miss_alike(plan: FingertipPlan) -> None:
    """n errors of n pressing fingers, divided by n + 1; each clipped."""
    controller = start(plan)
    for aside, clipped in ((0.004, 0.004), (0.05, 0.02), (-0.05, -0.02)):
        off = np.zeros(LAYOUT.hand_joints)
        off[LAYOUT.slide] = -aside
        found = added(plan, off, tip_error=0.02)
        for index, hand in enumerate(HANDS):
            pressing = int((plan.finger_key[FRAME, index] >= 0).sum())
            assert pressing >= 2
            # The hand slides along the keyboard: all its fingertips are off by as much.
            points = hand.points(controller.aim(FRAME)[1][index] + off)
            error = controller.aim(FRAME)[0][index] - points[1:]
            np.testing.assert_allclose(error[:, 1], aside, atol=1e-9)
            move = np.zeros(LAYOUT.hand_joints)
            move[LAYOUT.slide] = clipped * pressing / (pressing + 1)
            np.testing.assert_allclose(found[index], hand.to_ctrl @ move, atol=1e-9)


def test_a_pressing_finger_pushes_down_with_the_force(plan: FingertipPlan) -> None:
    force = 5.0
    found = added(plan, 0.0, force=force)
    controller = start(plan)
    _, path = controller.aim(FRAME + 1)
    for index, hand in enumerate(HANDS):
        _, jacobian = hand.points_and_jacobian(path[index])
        down = -jacobian[1:, 2][plan.finger_key[FRAME, index] >= 0].sum(axis=0)
        wanted = np.linalg.lstsq(hand.to_ctrl.T, force * down, rcond=None)[0] / hand.gain
        np.testing.assert_allclose(found[index], wanted, atol=1e-9)


@pytest.mark.parametrize("aside", [0.012, -0.012, 0.006])
def test_a_finger_beside_its_key_is_lifted_and_does_not_press(
    plan: FingertipPlan, aside: float
) -> None:
    """With all fingers as far beside their keys, further than `astray` or not."""
    off = np.zeros(LAYOUT.hand_joints)
    off[LAYOUT.slide] = aside
    settings = {"force": 5.0, "depth": 0.018, "clear": 0.005}
    found = added(plan, off, astray=0.009, **settings)
    pressed = added(plan, off, **settings)
    controller = start(plan)
    for index, hand in enumerate(HANDS):
        keys = plan.finger_key[FRAME, index]
        points, jacobian = hand.points_and_jacobian(controller.aim(FRAME)[1][index] + off)
        beside = np.abs(points[1:, 1] - key_centres()[keys, 1]) > 0.009
        lifted = np.flatnonzero((keys >= 0) & beside)
        assert len(lifted) == ((keys >= 0).sum() if abs(aside) > 0.009 else 0)
        move = np.zeros(LAYOUT.hand_joints)
        for finger in lifted:
            mine = LAYOUT.finger_joints[finger]
            upward = jacobian[1 + finger, 2, mine]
            move[mine] = (0.018 + 0.005) * upward / (upward @ upward + 0.01**2)
        push = 0.0 if len(lifted) else pressed[index]
        np.testing.assert_allclose(found[index], hand.to_ctrl @ move + push, atol=1e-9)


def test_an_idle_finger_that_has_sunk_is_lifted(plan: FingertipPlan) -> None:
    """Half a centimetre below the tops of the keys it is; the finger that presses is not."""
    off = np.zeros(LAYOUT.hand_joints)
    off[LAYOUT.slides.stop - 1] = -0.03  # the forearm has sunk
    found = added(plan, off, sunk=0.005)
    controller = start(plan)
    some = 0
    for index, hand in enumerate(HANDS):
        points, jacobian = hand.points_and_jacobian(controller.aim(FRAME)[1][index] + off)
        low = points[1:, 2] < resting_height(points[1:, 0]) - 0.005
        move = np.zeros(LAYOUT.hand_joints)
        for finger in np.flatnonzero(low & (plan.finger_key[FRAME, index] < 0)):
            some += 1
            mine = LAYOUT.finger_joints[finger]
            upward = jacobian[1 + finger, 2, mine]
            config = DynamicConfig()
            move[mine] = (config.depth + config.clear) * upward / (upward @ upward + 0.01**2)
        np.testing.assert_allclose(found[index], hand.to_ctrl @ move, atol=1e-9)
    assert some > 0


def test_pressing_fingertips_aim_below_the_tops_of_their_keys(plan: FingertipPlan) -> None:
    controller = DynamicTracker().start(plan)
    depth = DynamicConfig().depth
    for index in range(2):
        keys = plan.finger_key[FRAME, index]
        tips = controller.aim(FRAME + 1)[0][index][keys >= 0]
        aim = KEY_REST[keys[keys >= 0]] - depth
        np.testing.assert_allclose(tips[:, 2], aim, atol=0.004)
        np.testing.assert_allclose(tips[:, 1], key_centres()[keys[keys >= 0], 1], atol=0.003)
