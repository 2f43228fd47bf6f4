"""The dynamic tracker: the forces it works out, and how near it stays to its plan."""

from __future__ import annotations

import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS, NO_KEY
from pianomime.music import Score, frame_metrics
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.plan.joint_path import HOME
from pianomime.players import rollout
from pianomime.songs.find import find_song
from pianomime.track import DynamicConfig, DynamicTracker, IkTracker, Tracker
from pianomime.track.dynamic import motion_torque, press_torque, to_actuators
from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.model import SIDES

JOINTS = 27
HANDS = {side: Hand(side) for side in SIDES}


def swinging(hand: Hand, frames: int) -> NDArray[np.float64]:
    """(T + 1, 27) a path from the rest pose to a hand that swings well above the keys."""
    time = np.arange(frames + 1)[:, None] * FRAME_SECONDS
    phase = np.arange(JOINTS)
    ranges = hand.high - hand.low
    middle = np.clip(0.5 * HOME, hand.low + 0.1 * ranges, hand.high - 0.1 * ranges)
    middle[:3] = 0.0, 0.05, -0.005
    width = np.minimum(0.06 * ranges, 0.15)
    width[:3] = 0.08, 0.01, 0.003
    swing = middle + width * np.sin(2 * np.pi * 0.4 * time + phase)
    share = np.clip(time / 1.0, 0.0, 1.0)
    return swing * (share**3 * (10 - 15 * share + 6 * share**2))


def plan_of(paths: list[NDArray[np.float64]]) -> FingertipPlan:
    tips = np.stack(
        [
            [hand.points(pose) for pose in path[1:]]
            for hand, path in zip(HANDS.values(), paths, strict=True)
        ],
        axis=1,
    )
    nothing, none = np.full((len(tips), 2, 5), NO_KEY, np.int8), np.empty(0, np.int8)
    return FingertipPlan(tips, nothing, none, none)


def follow(tracker: Tracker, plan: FingertipPlan) -> tuple[NDArray[np.float64], World]:
    """(T, 2, 5) [m] distances of the fingertips from the plan, and the World at the end."""
    world = World()
    away = np.empty((len(plan), 2, 5))
    for frame, *_ in rollout(tracker.start(plan), world, np.zeros(len(plan), bool)):
        away[frame] = np.linalg.norm((world.fingertips - plan.fingertips[frame])[:, 1:], axis=2)
    return away, world


@pytest.mark.parametrize("side", SIDES)
def test_motion_torque_is_mujocos_inverse_dynamics(side: str) -> None:
    hand = HANDS[side]
    model = copy.copy(hand.model)
    # Dry friction and joint limits are no part of the motion.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    path = swinging(hand, 20)
    torque = motion_torque(hand, path)
    velocity = np.diff(path, axis=0) / FRAME_SECONDS
    for step in range(1, 19):
        data.qpos[:] = (path[step] + path[step + 1]) / 2
        data.qvel[:] = velocity[step]
        data.qacc[:] = (velocity[step + 1] - velocity[step - 1]) / (2 * FRAME_SECONDS)
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(torque[step], data.qfrc_inverse, atol=1e-9)


@pytest.mark.parametrize("side", SIDES)
def test_no_force_holds_a_hand_still(side: str) -> None:
    """Gravity is compensated."""
    still = np.tile(HOME, (5, 1))
    np.testing.assert_allclose(motion_torque(HANDS[side], still), 0.0, atol=1e-9)


@pytest.mark.parametrize("side", SIDES)
def test_press_torque_does_the_work_of_a_newton(side: str) -> None:
    """Virtual work: torque times joint motion is force times fingertip motion."""
    hand, draw = HANDS[side], np.random.default_rng(0)
    path = np.tile(HOME, (4, 1))
    pressing = np.zeros((4, 5), bool)
    pressing[1, 2] = pressing[2, [0, 4]] = True
    torque = press_torque(hand, path, pressing)
    small = 1e-6 * draw.normal(size=JOINTS)
    sunk = (hand.points(HOME + small) - hand.points(HOME - small))[1:, 2] / 2
    np.testing.assert_allclose(torque @ small, -1.0 * pressing * sunk, atol=1e-12)
    assert not torque[[0, 3]].any()


@pytest.mark.parametrize("side", SIDES)
def test_actuators_give_what_torques_they_can(side: str) -> None:
    hand, draw = HANDS[side], np.random.default_rng(0)
    forces = draw.normal(size=(7, 23))
    np.testing.assert_allclose(to_actuators(hand, forces @ hand.to_ctrl), forces, atol=1e-12)
    torque = draw.normal(size=(7, JOINTS))
    left = torque - to_actuators(hand, torque) @ hand.to_ctrl
    # What is left over pulls no actuator: no other forces come nearer.
    np.testing.assert_allclose(left @ hand.to_ctrl.T, 0.0, atol=1e-12)


def test_follows_smooth_motion_to_a_few_millimetres() -> None:
    plan = plan_of([swinging(hand, 80) for hand in HANDS.values()])
    away, world = follow(DynamicTracker(), plan)
    assert world.blow_ups == 0
    assert np.median(away[20:]) < 0.004
    # The paper's tracker lags behind its slow actuators.
    lagging, _ = follow(IkTracker(), plan)
    assert np.median(away[20:]) < np.median(lagging[20:])


@pytest.mark.parametrize("make", [DynamicTracker, IkTracker])
def test_the_same_plan_gives_the_same_bits(make: type[DynamicTracker] | type[IkTracker]) -> None:
    score = Score.from_midi(find_song("twinkle-twinkle")).clip(0.0, 2.5)
    runs = []
    for _ in range(2):
        away, world = follow(make(), ZeroShotPlanner().plan(score))
        runs.append((away, world.data.qpos.copy(), world.data.qvel.copy()))
    for one, other in zip(*runs, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_tracker_can_be_used_again() -> None:
    score = Score.from_midi(find_song("twinkle-twinkle")).clip(0.0, 2.0)
    plan = ZeroShotPlanner().plan(score)
    tracker = DynamicTracker()
    first, _ = follow(tracker, plan)
    follow(tracker, plan_of([swinging(hand, 10) for hand in HANDS.values()]))
    again, _ = follow(tracker, plan)
    np.testing.assert_array_equal(again, first)


def test_plays_an_easy_song() -> None:
    score = Score.from_midi(find_song("beethoven-ode-to-joy")).clip(0.0, 5.0)
    plan = ZeroShotPlanner().plan(score)
    world = World()
    pressed = np.empty_like(score.roll())
    for step in rollout(DynamicTracker().start(plan), world, score.pedal_roll()):
        pressed[step.frame] = world.pressed
    assert frame_metrics(score.roll(), pressed).f1 > 0.85


@pytest.mark.parametrize("frames", [1, 2, 3])
@pytest.mark.parametrize("make", [DynamicTracker, IkTracker])
def test_short_plans(make: type[DynamicTracker] | type[IkTracker], frames: int) -> None:
    away, _ = follow(make(), plan_of([swinging(hand, frames) for hand in HANDS.values()]))
    assert np.isfinite(away).all()


def test_a_path_that_begins_from_the_plan_needs_fewer_steps() -> None:
    """From the home pose, as few would not bring fingers to their keys."""
    plan = ZeroShotPlanner().plan(Score.from_midi(find_song("bach-prelude-c")).clip(0.0, 8.0))
    assert plan.joints is not None
    config = DynamicConfig()
    few = replace(config, path=replace(config.path, iterations=config.refine))
    away = []
    for each in (plan, replace(plan, joints=None)):
        controller = DynamicTracker(few).start(each)
        aims = np.stack([controller.aim(frame + 1)[0] for frame in range(len(plan) - 1)])
        beside = (aims - plan.fingertips[:-1, :, 1:])[plan.finger_key[:-1] != NO_KEY]
        away.append(np.linalg.norm(beside[:, :2], axis=1).mean())
    assert away[0] < 0.5 * away[1]
