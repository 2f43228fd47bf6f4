"""What a finger observes, part by part, by the meaning of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, FRAME_SECONDS, KEYS, NO_KEY
from pianomime.plan import FingertipPlan
from pianomime.plan.joint_path import resting_height
from pianomime.policies.finger_residual import (
    ACTIONS,
    AMPLITUDE,
    SIZE,
    FingerObservation,
    controls,
)
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres

LEFT, RIGHT = 0, 1
THUMB, INDEX, MIDDLE, RING, LITTLE = range(5)
FRAMES, NOW = 16, 6
KEY, NEXT = 51, 52
ALONG = key_centres()[:, 1]
AT = {
    "finger": slice(0, 5),
    "presses": slice(5, 12),
    "presses its present key": slice(12, 19),
    "distance to keys": slice(19, 26),
    "key is black": slice(26, 27),
    "key state": slice(27, 28),
    "tip error": slice(28, 31),
    "height": slice(31, 32),
    "unwanted keys": slice(32, 34),
    "place along the key": slice(34, 35),
    "neighbours press": slice(35, 37),
    "neighbours press next": slice(37, 39),
    "joint errors": slice(39, 44),
    "joint velocities": slice(44, 49),
    "forearm": slice(49, 51),
}
"""Where each part is: networks that were trained expect it there."""


@dataclass
class Aims:
    """A controller that aims at given tips (2, 5, 3) and joints (2, 27)."""

    plan: FingertipPlan
    tips: NDArray[np.float64]
    path: NDArray[np.float64]

    def aim(self, frame: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self.tips, self.path


class Scene:
    """Everything is still, over keys far from each other, and nothing is pressed; to be changed."""

    def __init__(self) -> None:
        self.finger_key = np.full((FRAMES, 2, 5), NO_KEY, np.int8)
        self.points = np.zeros((2, 6, 3))
        self.points[LEFT, 1:, 1] = ALONG[[30, 25, 20, 15, 10]]
        self.points[RIGHT, 1:, 1] = ALONG[[KEY, 56, 61, 66, 71]]
        self.aims = self.points[:, 1:].copy()
        self.qpos = np.zeros(LAYOUT.qpos_size)
        self.path = np.zeros((2, LAYOUT.hand_joints))
        self.velocity = np.zeros(LAYOUT.hands_size)
        self.key_state = np.zeros(KEYS)

    def press(self, hand: int, finger: int, key: int, *frames: int) -> None:
        for frame in frames:
            self.finger_key[NOW + frame, hand, finger] = key

    def see(self, hand: int, finger: int, part: str) -> list[float]:
        nobody = np.empty(0, np.int8)
        plan = FingertipPlan(np.zeros((FRAMES, 2, 6, 3)), self.finger_key, nobody, nobody)
        around = FingerObservation(Aims(plan, self.aims, self.path))
        rows = around.encode(NOW, self.qpos, self.velocity, self.key_state, self.points)
        assert rows.shape == (10, SIZE)
        assert rows.dtype == np.float32
        return rows[5 * hand + finger, AT[part]].tolist()


@pytest.fixture
def scene() -> Scene:
    return Scene()


def close(*values: float) -> object:
    return pytest.approx(list(values), abs=1e-5)


def test_the_parts_fill_the_observation() -> None:
    assert AT["forearm"].stop == SIZE


@pytest.mark.parametrize("hand", [LEFT, RIGHT])
def test_which_finger_it_is(scene: Scene, hand: int) -> None:
    for finger in range(5):
        assert scene.see(hand, finger, "finger") == np.eye(5)[finger].tolist()


def test_presses_from_two_frames_before_to_four_after(scene: Scene) -> None:
    scene.press(RIGHT, INDEX, KEY, -2, -1, 0)
    scene.press(RIGHT, INDEX, NEXT, 3, 4, 5)
    scene.press(RIGHT, MIDDLE, 60, 1)
    assert scene.see(RIGHT, INDEX, "presses") == [1, 1, 1, 0, 0, 1, 1]
    assert scene.see(RIGHT, INDEX, "presses its present key") == [1, 1, 1, 0, 0, 0, 0]
    assert scene.see(RIGHT, MIDDLE, "presses") == [0, 0, 0, 1, 0, 0, 0]
    assert scene.see(RIGHT, MIDDLE, "presses its present key") == [0] * 7
    assert scene.see(LEFT, INDEX, "presses") == [0] * 7


@pytest.mark.parametrize(("hand", "sign"), [(LEFT, -1), (RIGHT, 1)])
def test_how_far_keys_are_beside_it(scene: Scene, hand: int, sign: int) -> None:
    """In centimetres, at most four, outward from the thumb; 0 where it presses nothing."""
    scene.points[hand, 1 + INDEX, 1] = ALONG[KEY]
    scene.press(hand, INDEX, KEY, 0)
    scene.press(hand, INDEX, KEY + 1, 1)
    scene.press(hand, INDEX, KEY + 24, 2)
    step = sign * (ALONG[KEY + 1] - ALONG[KEY]) / 0.01
    assert scene.see(hand, INDEX, "distance to keys") == close(0, 0, 0, step, sign * 4, 0, 0)


def test_the_colour_and_the_state_of_its_key(scene: Scene) -> None:
    black, white = 52, 51
    assert BLACK[black]
    assert not BLACK[white]
    scene.key_state[[0, black, white]] = 0.9, 0.25, 0.5
    assert scene.see(RIGHT, INDEX, "key state") == [0]
    assert scene.see(RIGHT, INDEX, "key is black") == [0]
    for key, colour, state in ((black, 1, 0.25), (white, 0, 0.5)):
        scene.press(RIGHT, INDEX, key, 0)
        assert scene.see(RIGHT, INDEX, "key is black") == [colour]
        assert scene.see(RIGHT, INDEX, "key state") == [state]


@pytest.mark.parametrize(("hand", "sign"), [(LEFT, -1), (RIGHT, 1)])
def test_where_the_tip_should_be(scene: Scene, hand: int, sign: int) -> None:
    scene.aims[hand, MIDDLE] += [0.01, 0.02, -0.03]
    assert scene.see(hand, MIDDLE, "tip error") == close(1, sign * 2, -3)
    assert scene.see(hand, INDEX, "tip error") == close(0, 0, 0)
    scene.aims[hand, MIDDLE] += [1, 1, -1]
    assert scene.see(hand, MIDDLE, "tip error") == close(4, sign * 4, -4)


@pytest.mark.parametrize(("above", "seen"), [(0.02, 2), (-0.01, -1), (0.5, 5), (-0.5, -3)])
def test_its_height_above_the_keys(scene: Scene, above: float, seen: float) -> None:
    for x in (-0.02, 0.05):
        scene.points[RIGHT, 1 + RING, [0, 2]] = x, resting_height(np.array(x)) + above
        assert scene.see(RIGHT, RING, "height") == close(seen)
        assert scene.see(RIGHT, RING, "place along the key") == close(x / 0.05)


@pytest.mark.parametrize("hand", [LEFT, RIGHT])
def test_keys_near_it_that_should_be_up(scene: Scene, hand: int) -> None:
    """Within 16 mm: the greatest on the side of the thumb, and on the other."""
    key = 40
    scene.points[hand, 1 + INDEX, 1] = ALONG[key] + 0.001 * (1 if hand == RIGHT else -1)
    thumbward, outward = (key - 1, key + 1) if hand == RIGHT else (key + 1, key - 1)
    scene.key_state[[key - 3, thumbward, key, outward, key + 3]] = 1.0, 0.25, 0.1, 0.5, 1.0
    assert scene.see(hand, INDEX, "unwanted keys") == close(0.25, 0.5)
    # Of a key that anybody presses nothing is unwanted.
    scene.press(hand, LITTLE, thumbward, 0)
    assert scene.see(hand, INDEX, "unwanted keys") == close(0.1, 0.5)
    scene.press(RIGHT, THUMB, outward, 0)
    assert scene.see(hand, INDEX, "unwanted keys") == close(0.1, 0.0)


@pytest.mark.parametrize(("frame", "part"), [(0, "neighbours press"), (1, "neighbours press next")])
def test_what_its_neighbours_do(scene: Scene, frame: int, part: str) -> None:
    """First that on the side of the thumb; the thumb and the little finger have one alone."""
    scene.press(RIGHT, MIDDLE, 61, frame)
    seen = [scene.see(RIGHT, finger, part) for finger in range(5)]
    assert seen == [[0, 0], [0, 1], [0, 0], [1, 0], [0, 0]]
    scene.press(LEFT, THUMB, 30, frame)
    assert scene.see(LEFT, INDEX, part) == [1, 0]
    assert scene.see(LEFT, THUMB, part) == [0, 0]


@pytest.mark.parametrize("hand", [LEFT, RIGHT])
def test_errors_and_velocities_of_its_joints(scene: Scene, hand: int) -> None:
    """In fifths of a radian, and of a radian a frame; 0 for joints that it lacks."""
    joints = LAYOUT.finger_joints[INDEX]
    size = joints.stop - joints.start
    assert size < 5
    scene.path[hand, joints] = 0.2 * np.arange(1, size + 1)
    scene.qpos[LAYOUT.joints[hand]][joints] = 0.1
    scene.velocity[LAYOUT.among_hands(hand)][joints] = -0.2 / FRAME_SECONDS
    errors, nothing = np.arange(1, size + 1) - 0.5, [0.0] * (5 - size)
    assert scene.see(hand, INDEX, "joint errors") == close(*errors, *nothing)
    assert scene.see(hand, INDEX, "joint velocities") == close(*[-1.0] * size, *nothing)
    for part in ("joint errors", "joint velocities"):
        assert scene.see(hand, MIDDLE, part) == [0] * 5
        assert scene.see(1 - hand, INDEX, part) == [0] * 5


@pytest.mark.parametrize(("hand", "sign"), [(LEFT, -1), (RIGHT, 1)])
def test_error_and_velocity_of_the_forearm(scene: Scene, hand: int, sign: int) -> None:
    """In centimetres, and a frame; outward from the thumb."""
    scene.path[hand, LAYOUT.slide] = 0.02
    scene.velocity[LAYOUT.among_hands(hand)][LAYOUT.slide] = 0.01 / FRAME_SECONDS
    for finger in range(5):
        assert scene.see(hand, finger, "forearm") == close(sign * 2, sign * 1)
    assert scene.see(1 - hand, INDEX, "forearm") == [0, 0]


def test_an_action_moves_the_actuators_of_its_finger() -> None:
    actions = np.zeros((10, ACTIONS))
    actions[5 * RIGHT + INDEX] = [0.5, -0.5, 9.0, 1.0, 1.0]
    actions[5 * LEFT + THUMB] = 0.1
    added = controls(actions)
    wanted = np.zeros(LAYOUT.ctrl_size)
    index = LAYOUT.finger_actuators[INDEX]
    mine = wanted[LAYOUT.actuators[RIGHT]][index]
    mine[:] = AMPLITUDE * np.array([0.5, -0.5, 1.0, 1.0, 1.0])[: len(mine)]
    wanted[LAYOUT.actuators[LEFT]][LAYOUT.finger_actuators[THUMB]] = 0.1 * AMPLITUDE
    np.testing.assert_allclose(added, wanted)
    assert AMPLITUDE == 0.15
