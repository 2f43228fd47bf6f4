"""The player that says fingers, then fingertips, then controls."""

from __future__ import annotations

import numpy as np
import pytest

from pianomime import load_player
from pianomime.errors import InputError
from pianomime.learn.three_stage.fingering_samples import mirrored
from pianomime.music import Score
from pianomime.players.generalist import ThreeStagePlayer
from pianomime.policies.features import holding_controls
from pianomime.policies.three_stage import fingering, hand_controls, hand_motion
from pianomime.policies.three_stage.controller import Stages, ThreeStageController
from pianomime.policies.three_stage.fingering import FingeringRollout, Touched, key_observation
from pianomime.world import World
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres

SCORE = Score([44, 48, 25], [0.2, 0.2, 0.4], [0.6, 0.6, 0.8], [80, 80, 80], pedal=np.zeros((0, 2)))
OCTAVE = 12


class Made:
    """A network of made-up weights, the same for the same sizes."""

    def __init__(self, outputs: tuple[int, int], scale: float = 0.0) -> None:
        self.outputs, self.scale = outputs, scale

    def __call__(self, inputs):
        seen = inputs["observation"]
        weights = np.random.default_rng(0).normal(size=(seen.shape[1], int(np.prod(self.outputs))))
        return [(self.scale * seen @ weights).reshape(-1, *self.outputs).astype(np.float32)]


def made_up() -> Stages:
    return Stages(
        Made((1, fingering.CHOICES), 1.0),
        Made((4, hand_motion.PLANE)),
        Made((1, hand_controls.ACTIONS)),
    )


def random_song(seed: int, frames: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Goals and fingers, some of which press keys of the goals."""
    draw = np.random.default_rng(seed)
    goal = np.zeros((frames, 88), bool)
    fingers = np.full((frames, 2, 5), -1, np.int8)
    for first in range(0, frames - 5, 5):
        keys = draw.choice(np.arange(24, 60), 3, replace=False)
        goal[first : first + 4, keys] = True
        for key, place in zip(keys, draw.choice(10, 3, replace=False), strict=True):
            fingers[first : first + 4].reshape(-1, 10)[:, place] = key
    return goal, fingers


def observe(goal, fingers, frame):
    keys = np.flatnonzero(goal[frame])
    window = np.pad(goal, ((1, fingering.GOALS), (0, 0)))[frame : frame + 1 + fingering.GOALS]
    touched = Touched(*(part[[frame] * len(keys)] for part in Touched.before(fingers)))
    return key_observation(np.repeat(window[None], len(keys), axis=0), touched, keys)


def test_what_was_touched_is_the_same_frame_by_frame():
    _, fingers = random_song(0)
    at_once = Touched.before(fingers)
    now = Touched(*np.full((2, 1, 10), -1))
    for frame, keys in enumerate(fingers):
        np.testing.assert_array_equal(now.key[0], at_once.key[frame])
        known = now.key[0] >= 0
        np.testing.assert_array_equal(now.since[0][known], at_once.since[frame][known])
        now = now.then(keys.reshape(1, 10).astype(int))


def test_an_octave_up_a_key_looks_the_same_but_for_its_place():
    goal, fingers = random_song(1)
    up = np.roll(goal, OCTAVE, axis=1), np.where(fingers >= 0, fingers + OCTAVE, -1)
    here, there = observe(goal, fingers, 25), observe(*up, 25)
    differ = np.flatnonzero((here != there).any(axis=0))
    assert len(differ) == 1
    np.testing.assert_allclose(there[:, differ] - here[:, differ], OCTAVE / 22)


def test_a_mirror_twice_is_none():
    goal, fingers = random_song(2)
    np.testing.assert_array_equal(mirrored(*mirrored(goal, fingers))[0], goal)
    np.testing.assert_array_equal(mirrored(*mirrored(goal, fingers))[1], fingers)
    # What a finger presses is in the goal, there as here, and it is black where it was black.
    reflected, swapped = mirrored(goal, fingers)
    frame, hand, finger = np.nonzero(swapped >= 0)
    assert reflected[frame, swapped[frame, hand, finger]].all()
    np.testing.assert_array_equal(swapped[:, 0] >= 0, fingers[:, 1] >= 0)


@pytest.mark.parametrize("keys", [3, 10, 12])
def test_no_finger_gets_two_keys_and_no_key_two_fingers(keys):
    """Even where the network always likes the first finger best, and nobody least."""

    def stubborn(inputs):
        scores = -np.arange(fingering.CHOICES, dtype=np.float32)
        return [np.tile(scores, (len(inputs["observation"]), 1, 1))]

    goal = np.zeros((1, 88), bool)
    goal[0, 20 : 20 + keys] = True
    pressed = FingeringRollout(goal, stubborn).step()
    taken = pressed[pressed >= 0]
    assert sorted(taken.tolist()) == list(range(20, 20 + min(keys, 10)))


def test_of_music_further_ahead_nothing_is_known():
    goal, _ = random_song(4, 200)
    other = goal.copy()
    change = 120
    other[change:] = np.roll(goal[change:], 7, axis=1)
    first, second = (
        FingeringRollout(each, Made((1, fingering.CHOICES), 1.0)) for each in (goal, other)
    )
    for _ in range(change - fingering.GOALS + 1):
        np.testing.assert_array_equal(first.step(), second.step())


def test_after_the_end_no_key_is_pressed():
    rollout = FingeringRollout(np.ones((2, 88), bool), Made((1, fingering.CHOICES), 1.0))
    assert [bool((rollout.step() >= 0).any()) for _ in range(60)] == [True] * 2 + [False] * 58


@pytest.mark.parametrize("side", [0, 1])
def test_actions_of_motion_are_points(side):
    draw = np.random.default_rng(5)
    points, future = draw.normal(size=(3, 6, 2)), draw.normal(size=(3, 4, 6, 2))
    sides = np.full(3, side)
    action = hand_motion.motion_action(future, points, sides)
    np.testing.assert_allclose(
        hand_motion.points_of_action(action, points, sides), future, atol=1e-6
    )


def test_a_left_hand_sees_in_a_mirror_what_a_right_hand_sees():
    """Keys are symmetric about D4, key 41, where y is that of its centre."""
    draw, middle = np.random.default_rng(6), key_centres()[41, 1]
    presses = draw.integers(30, 52, (1, hand_motion.PRESSES, 5)).astype(np.int8)
    right = draw.normal(0, 0.1, (1, 6, 2)) + [0, middle]
    before = right - 0.01
    left, left_before = (points * [1, -1] + [0, 2 * middle] for points in (right, before))
    one = hand_motion.motion_observation(presses, right, before, np.array([1]))
    other = hand_motion.motion_observation(
        (82 - presses).astype(np.int8), left, left_before, np.array([0])
    )
    # The middles of black keys are not quite in a mirror.
    np.testing.assert_allclose(one, other, atol=0.06)
    blank = hand_motion.motion_observation(
        np.full_like(presses, -1), left, left_before, np.array([0])
    )
    assert not blank[:, : -2 * hand_motion.PLANE].any()


@pytest.mark.parametrize("side", [0, 1])
def test_actions_are_controls(side):
    draw = np.random.default_rng(7)
    ctrl, joints, sides = draw.normal(size=(4, 23)), draw.normal(size=(4, 27)), np.full(4, side)
    action = hand_controls.controls_action(ctrl, joints, sides)
    np.testing.assert_allclose(hand_controls.controls_of_action(action, joints, sides), ctrl)


def test_a_left_hand_is_controlled_in_a_mirror():
    """The same pose of both hands, but for where it is along the keyboard: the same observation."""
    draw = np.random.default_rng(9)
    joints, velocities = draw.normal(size=(2, 1, 27))
    points, targets = (
        draw.normal(size=(1, 6, 3)),
        draw.normal(size=(1, hand_controls.TARGETS, 6, 3)),
    )
    presses = np.full((1, hand_controls.TARGETS, 5), -1, np.int8)
    left_joints, left_velocities = joints.copy(), velocities.copy()
    for row in (left_joints, left_velocities):
        row[:, LAYOUT.slide] *= -1
    mirror, keys = np.array([1, -1, 1]), np.zeros((1, 88))
    right = hand_controls.controls_observation(
        joints, velocities, keys, points, targets, presses, np.array([1])
    )
    left = hand_controls.controls_observation(
        left_joints,
        left_velocities,
        keys,
        points * mirror,
        targets * mirror,
        presses,
        np.array([0]),
    )
    np.testing.assert_allclose(right, left, atol=1e-6)
    action = draw.normal(size=(1, 23))
    moved = [
        hand_controls.controls_of_action(action, pose, np.array([side]))[0]
        for pose, side in ((joints, 1), (left_joints, 0))
    ]
    slide = LAYOUT.slide_actuators.start
    np.testing.assert_allclose(moved[0][slide], -moved[1][slide])
    np.testing.assert_allclose(np.delete(moved[0], slide), np.delete(moved[1], slide))


def test_controls_do_not_see_where_on_the_keyboard_a_hand_is():
    draw, far = np.random.default_rng(8), 0.3
    joints, points = draw.normal(size=(1, 27)), draw.normal(size=(1, 6, 3))
    targets, side = draw.normal(size=(1, hand_controls.TARGETS, 6, 3)), np.array([1])
    presses = np.full((1, hand_controls.TARGETS, 5), -1, np.int8)
    rest = np.zeros((1, 27)), np.zeros((1, 88))
    here = hand_controls.controls_observation(joints, *rest, points, targets, presses, side)
    moved = joints.copy()
    moved[:, LAYOUT.slide] += far
    along = np.array([0, far, 0])
    there = hand_controls.controls_observation(
        moved, *rest, points + along, targets + along, presses, side
    )
    np.testing.assert_allclose(here, there, atol=1e-5)


def test_the_plan_that_is_kept_is_what_was_decided():
    performance = ThreeStagePlayer("made up", made_up()).play(SCORE)
    plan = performance.plan
    assert len(plan) == SCORE.frames()
    assert plan.keys()[~SCORE.roll()].sum() == 0
    frame, hand, finger = np.nonzero(plan.finger_key >= 0)
    key = plan.finger_key[frame, hand, finger]
    tips = plan.fingertips[frame, hand, finger + 1]
    np.testing.assert_allclose(tips[:, 1], key_centres()[key, 1])
    np.testing.assert_array_equal(tips[:, 2], 0.0)


def test_actions_of_zero_hold_the_hands_where_they_are():
    controller, world = ThreeStageController(SCORE, made_up()), World()
    ctrl = controller.control(0, world)
    np.testing.assert_allclose(ctrl, holding_controls(world.qpos_hands[None])[0], atol=1e-6)


def test_without_weights_there_is_one_clear_line(tmp_path):
    with pytest.raises(InputError, match="pianomime train-stage fingering"):
        load_player("three-stage", weights=tmp_path)
