"""The layout: names, ranges and sizes against the compiled model, joint by joint."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.plan import LEFT, POINTS, RIGHT
from pianomime.world.hand import Hand, by_actuator, hand_points
from pianomime.world.layout import FINGER_COUNT, LAYOUT, POINT_COUNT, POINTS_SIZE, TIPS_SIZE, Layout
from pianomime.world.model import (
    FINGER_PREFIXES,
    SIDES,
    add_hand,
    build_spec,
    fingertip_sites,
    world_model,
)

MODEL = world_model()
FINGER_JOINTS = ("THJ", "FFJ", "MFJ", "RFJ", "LFJ")


def joint(index: int) -> str:
    """The name of the joint at an index of the positions."""
    named = MODEL.joint(index)
    assert named.qposadr[0] == index  # every joint has one position
    return str(named.name)


def within(part: slice, whole: slice) -> range:
    """Indices in a World of a range that counts from the beginning of another one."""
    return range(whole.start + part.start, whole.start + part.stop)


def test_sizes_are_those_of_the_model() -> None:
    assert (LAYOUT.keys, LAYOUT.qpos_size, LAYOUT.ctrl_size) == (KEYS, MODEL.nq, MODEL.nu)
    assert LAYOUT.hands_size == 2 * LAYOUT.hand_joints == MODEL.nq - KEYS
    assert 2 * LAYOUT.hand_actuators == MODEL.nu
    assert len(POINTS) == POINT_COUNT == len(fingertip_sites("rh"))
    assert (POINTS_SIZE, TIPS_SIZE) == (2 * POINT_COUNT * 3, 2 * FINGER_COUNT * 3)


def test_keys_come_first_then_the_right_hand_then_the_left() -> None:
    assert [joint(index) for index in range(KEYS)] == [f"key_{key}" for key in range(KEYS)]
    assert LAYOUT.joints[RIGHT].start == KEYS
    assert LAYOUT.joints[RIGHT].stop == LAYOUT.joints[LEFT].start
    assert LAYOUT.joints[LEFT].stop == MODEL.nq
    assert LAYOUT.actuators[RIGHT] == slice(0, LAYOUT.hand_actuators)
    assert LAYOUT.actuators[LEFT] == slice(LAYOUT.hand_actuators, MODEL.nu)


@pytest.mark.parametrize("hand", [LEFT, RIGHT])
def test_names_belong_to_their_hand(hand: int) -> None:
    joints, actuators = LAYOUT.joints[hand], LAYOUT.actuators[hand]
    assert [joint(index) for index in range(joints.start, joints.stop)] == [
        f"{SIDES[hand]}_{name}" for name in LAYOUT.joint_names
    ]
    assert [MODEL.actuator(index).name for index in range(actuators.start, actuators.stop)] == [
        f"{SIDES[hand]}_{name}" for name in LAYOUT.actuator_names
    ]
    alone = Hand(SIDES[hand])
    assert (alone.joints, alone.actuators) == (joints, actuators)
    assert [alone.model.joint(index).name for index in range(alone.model.nq)] == [
        f"{SIDES[hand]}_{name}" for name in LAYOUT.joint_names
    ]


def test_parts_of_a_hand_cover_it_once() -> None:
    joints = [LAYOUT.slides, LAYOUT.wrist, *LAYOUT.finger_joints]
    assert sorted(index for part in joints for index in range(part.start, part.stop)) == list(
        range(LAYOUT.hand_joints)
    )
    actuators = [LAYOUT.slide_actuators, LAYOUT.wrist_actuators, *LAYOUT.finger_actuators]
    assert sorted(index for part in actuators for index in range(part.start, part.stop)) == list(
        range(LAYOUT.hand_actuators)
    )
    assert LAYOUT.arm_joints == min(part.start for part in LAYOUT.finger_joints)
    fingers = {index for part in LAYOUT.finger_actuators for index in range(part.start, part.stop)}
    assert sorted(fingers | set(LAYOUT.arm_actuators)) == list(range(LAYOUT.hand_actuators))
    assert not fingers & set(LAYOUT.arm_actuators)


@pytest.mark.parametrize("hand", [LEFT, RIGHT])
def test_fingers_have_their_own_joints_and_actuators(hand: int) -> None:
    assert tuple(prefix.upper() + "J" for prefix in FINGER_PREFIXES) == FINGER_JOINTS
    for finger, prefix in enumerate(FINGER_JOINTS):
        for index in within(LAYOUT.finger_joints[finger], LAYOUT.joints[hand]):
            assert joint(index).startswith(f"{SIDES[hand]}_{prefix}")
        for index in within(LAYOUT.finger_actuators[finger], LAYOUT.actuators[hand]):
            assert MODEL.actuator(index).name.startswith(f"{SIDES[hand]}_{prefix}")


@pytest.mark.parametrize("hand", [LEFT, RIGHT])
def test_slides_move_the_hand_along_the_keyboard_toward_the_piano_and_up(hand: int) -> None:
    types = [MODEL.jnt_type[index] for index in within(LAYOUT.slides, LAYOUT.joints[hand])]
    assert types == [mujoco.mjtJoint.mjJNT_SLIDE] * 3
    at_rest = np.zeros((1, LAYOUT.hands_size))
    moves = []
    for slide in within(LAYOUT.slides, LAYOUT.among_hands(hand)):
        moved = at_rest.copy()
        moved[0, slide] = 0.01
        moves.append((hand_points(moved) - hand_points(at_rest))[0])
    for move, direction in zip(
        moves, np.array([[0, 0.01, 0], [-0.01, 0, 0], [0, 0, 0.01]]), strict=True
    ):
        expected = np.zeros((2, POINT_COUNT, 3))
        expected[hand] = direction
        np.testing.assert_allclose(move, expected, atol=1e-12)
    assert LAYOUT.joint_names[LAYOUT.slide] == "forearm_tx"


def test_coupled_joints_are_those_of_one_tendon() -> None:
    assert [
        (LAYOUT.joint_names[one], LAYOUT.joint_names[other]) for one, other in LAYOUT.coupled
    ] == [(f"{finger}J2", f"{finger}J1") for finger in ("FF", "MF", "RF", "LF")]
    for row in Hand("lh").to_ctrl:
        pulled = tuple(np.flatnonzero(row).tolist())
        assert len(pulled) == 1 or pulled in LAYOUT.coupled


def test_values_by_actuator_are_where_the_names_say() -> None:
    values = by_actuator(1.0, 2.0, 3.0)
    for name, value in zip(LAYOUT.actuator_names * 2, values, strict=True):
        kind = 3.0 if name.startswith("forearm") else 2.0 if name.startswith("WR") else 1.0
        assert value == kind


def test_among_hands_leaves_out_the_keys() -> None:
    qpos = np.arange(float(LAYOUT.qpos_size))
    hands: NDArray[np.float64] = qpos[KEYS:]
    for hand in (LEFT, RIGHT):
        np.testing.assert_array_equal(hands[LAYOUT.among_hands(hand)], qpos[LAYOUT.joints[hand]])


def test_hands_that_differ_are_refused() -> None:
    spec = build_spec()
    spec.actuator("lh_forearm_tx").name = "lh_forearm_along"
    with pytest.raises(ValueError, match="the hands differ"):
        Layout.of(spec.compile())


def test_parts_that_are_not_contiguous_are_refused() -> None:
    spec = build_spec()
    for side in SIDES:
        spec.actuator(f"{side}_MFJ3").name = f"{side}_FFJ9"
    with pytest.raises(ValueError, match="'FF' are not contiguous"):
        Layout.of(spec.compile())


def test_the_layout_follows_the_model() -> None:
    """The left hand first, and a hand with one joint less that nothing drives."""
    spec = mujoco.MjSpec()
    add_hand(spec, "lh")
    add_hand(spec, "rh")
    for side in SIDES:
        spec.delete(spec.actuator(f"{side}_LFJ5"))
        spec.delete(spec.joint(f"{side}_LFJ5"))
    layout = Layout.of(spec.compile())
    assert (layout.keys, layout.hand_joints) == (0, LAYOUT.hand_joints - 1)
    assert layout.joints[LEFT] == slice(0, layout.hand_joints)
    assert layout.hand_actuators == LAYOUT.hand_actuators - 1
    assert [
        (layout.joint_names[one], layout.joint_names[other]) for one, other in layout.coupled
    ] == [(f"{finger}J2", f"{finger}J1") for finger in ("FF", "MF", "RF", "LF")]
