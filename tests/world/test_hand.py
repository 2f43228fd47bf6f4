"""A hand alone: its points, their Jacobian, its actuators, and its mirror image."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES, Side
from pianomime.world_names import WORLDS

TX = 0  # The joint along the keyboard.
HANDS = {side: Hand(side) for side in SIDES}
SHARES = st.lists(st.floats(0, 1), min_size=LAYOUT.hand_joints, max_size=LAYOUT.hand_joints).map(
    np.array
)


def pose(hand: Hand, share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Joint positions at these shares of their ranges."""
    return hand.low + share * (hand.high - hand.low)


@pytest.mark.parametrize("side", SIDES)
@settings(max_examples=20, deadline=None)
@given(share=SHARES)
def test_points_are_those_of_the_world(side: str, share: NDArray[np.float64]) -> None:
    hand, world = HANDS[side], World()
    qpos = world.qpos
    qpos[hand.joints] = pose(hand, share)
    world.reset(qpos)
    points = hand.points(qpos[hand.joints])
    np.testing.assert_allclose(points, world.fingertips[SIDES.index(side)], atol=1e-12)


@settings(max_examples=50, deadline=None)
@given(share=SHARES)
def test_left_mirrors_right(share: NDArray[np.float64]) -> None:
    """Law: the same joint angles, with the forearm on the other side, give mirrored points."""
    right = pose(HANDS["rh"], share)
    left = right.copy()
    left[TX] *= -1
    np.testing.assert_allclose(
        HANDS["lh"].points(left), HANDS["rh"].points(right) * [1.0, -1.0, 1.0], atol=1e-9
    )


@pytest.mark.parametrize("side", SIDES)
@settings(max_examples=10, deadline=None)
@given(share=SHARES)
def test_jacobian_is_the_slope_of_the_points(side: str, share: NDArray[np.float64]) -> None:
    hand, step = HANDS[side], 1e-6
    qpos = pose(hand, share)
    points, jacobian = hand.points_and_jacobian(qpos)
    np.testing.assert_array_equal(points, hand.points(qpos))
    slopes = np.stack(
        [
            (hand.points(qpos + step * one) - hand.points(qpos - step * one)) / (2 * step)
            for one in np.eye(LAYOUT.hand_joints)
        ],
        axis=-1,
    )
    np.testing.assert_allclose(jacobian, slopes, atol=1e-7)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("side", SIDES)
def test_many_poses_are_as_each_alone_bit_for_bit(side: Side, world: str) -> None:
    hand = Hand(side, world)
    shares = np.random.default_rng(0).random((40, LAYOUT.hand_joints))
    path = hand.low + shares * (hand.high - hand.low)
    points, jacobians = hand.points_and_jacobians(path)
    np.testing.assert_array_equal(points, hand.points_along(path))
    for row, alone in enumerate(path):
        point, jacobian = hand.points_and_jacobian(alone)
        np.testing.assert_array_equal(points[row], point)
        np.testing.assert_array_equal(jacobians[row], jacobian)
    nothing = hand.points_and_jacobians(path[:0])
    assert [array.shape for array in nothing] == [(0, 6, 3), (0, 6, 3, LAYOUT.hand_joints)]


@pytest.mark.parametrize("side", SIDES)
def test_points_are_the_callers_own(side: str) -> None:
    hand = HANDS[side]
    points = hand.points(np.zeros(LAYOUT.hand_joints))
    kept = points.copy()
    hand.points(np.full(LAYOUT.hand_joints, 0.1))
    np.testing.assert_array_equal(points, kept)


@pytest.mark.parametrize("side", SIDES)
def test_each_actuator_pulls_at_its_joints(side: str) -> None:
    hand = HANDS[side]
    for index, row in enumerate(hand.to_ctrl):
        world = World().model
        name = world.actuator(range(world.nu)[hand.actuators][index]).name
        first = range(world.nq)[hand.joints][0]
        pulled = [world.joint(first + joint).name for joint in np.flatnonzero(row)]
        tendon = [name.replace("J0", "J2"), name.replace("J0", "J1")]
        assert pulled == (tendon if name.endswith("J0") else [name])
        assert (row[row != 0] == 1.0).all()


@pytest.mark.parametrize("side", SIDES)
def test_ranges_of_controls_are_those_of_the_joints(side: str) -> None:
    hand = HANDS[side]
    single = hand.to_ctrl.sum(axis=1) == 1
    np.testing.assert_allclose(hand.ctrl_low[single], (hand.to_ctrl @ hand.low)[single])
    np.testing.assert_allclose(hand.ctrl_high[single], (hand.to_ctrl @ hand.high)[single])
