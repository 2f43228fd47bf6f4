"""The joint path: it hits what it is to hit, keeps clear of the rest, and stays in its limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pianomime.plan.joint_path import (
    BLACK_REST,
    HOME,
    WHITE_REST,
    PathProblem,
    resting_height,
    smooth_path,
)
from pianomime.world.hand import Hand
from pianomime.world.model import SIDES

JOINTS = 27
HANDS = {side: Hand(side) for side in SIDES}
REST = np.zeros(JOINTS)


def no_targets(frames: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Nothing wanted: targets (T, 6, 3), weights (T, 6, 3), clearance (T, 5)."""
    return np.zeros((frames, 6, 3)), np.zeros((frames, 6, 3)), np.full((frames, 5), np.nan)


def test_heights_of_resting_fingertips() -> None:
    assert pytest.approx(0.035 - 0.0225) == BLACK_REST - WHITE_REST
    heights = resting_height(np.array([0.05, 0.031, 0.019, 0.0]))
    np.testing.assert_allclose(heights, [WHITE_REST, WHITE_REST, BLACK_REST, BLACK_REST])


@pytest.mark.parametrize("side", SIDES)
def test_home_is_within_the_limits(side: str) -> None:
    hand = HANDS[side]
    assert ((hand.low <= HOME) & (hand.high >= HOME)).all()


@pytest.mark.parametrize("side", SIDES)
def test_begins_where_it_is_told(side: str) -> None:
    path = smooth_path(PathProblem(HANDS[side], REST, *no_targets(10)))
    assert path.shape == (11, JOINTS)
    np.testing.assert_array_equal(path[0], REST)


@pytest.mark.parametrize("side", SIDES)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), frames=st.integers(1, 30))
def test_stays_within_the_limits_whatever_is_wished(side: str, seed: int, frames: int) -> None:
    hand, draw = HANDS[side], np.random.default_rng(seed)
    targets = draw.uniform([-0.5, -1.0, -0.2], [0.5, 1.0, 0.5], (frames, 6, 3))
    weights = draw.choice([0.0, 100.0, 1000.0], (frames, 6, 3))
    clearance = draw.choice([np.nan, 0.0, 0.05], (frames, 5))
    path = smooth_path(PathProblem(hand, REST, targets, weights, clearance))
    assert path.shape == (frames + 1, JOINTS)
    assert np.isfinite(path).all()
    assert ((hand.low <= path[1:]) & (path[1:] <= hand.high)).all()


@pytest.mark.parametrize("side", SIDES)
def test_a_single_frame(side: str) -> None:
    path = smooth_path(PathProblem(HANDS[side], REST, *no_targets(1)))
    assert path.shape == (2, JOINTS)
    assert np.isfinite(path).all()


@pytest.mark.parametrize("side", SIDES)
def test_hits_targets_on_time(side: str) -> None:
    """A fingertip is led to a point 10 cm away, and back: both are met within a millimetre."""
    hand = HANDS[side]
    targets, weights, clearance = no_targets(60)
    at_home = hand.points(HOME)
    for frame, shift in ((25, 0.1), (26, 0.1), (50, 0.0), (51, 0.0)):
        targets[frame, 2] = at_home[2] + [0.0, shift, -0.01]
        weights[frame, 2] = 1 / 0.001
    path = smooth_path(PathProblem(hand, REST, targets, weights, clearance))
    for frame in (25, 26, 50, 51):
        tip = hand.points(path[frame + 1])[2]
        assert np.linalg.norm(tip - targets[frame, 2]) < 1e-3


@pytest.mark.parametrize("side", SIDES)
def test_moves_smoothly(side: str) -> None:
    """A leap is begun before it is due: no frame asks for more than the hands can do."""
    hand = HANDS[side]
    targets, weights, clearance = no_targets(60)
    along = hand.points(HOME)[1:, 1]
    for frame, shift in ((20, -0.1), (40, 0.1)):
        targets[frame, 1:, 1] = along + shift
        weights[frame, 1:, 1] = 1 / 0.002
    path = smooth_path(PathProblem(hand, REST, targets, weights, clearance))
    acceleration = np.diff(path[:, 0], n=2) / 0.05**2
    assert np.abs(acceleration).max() < 20.0
    speed = np.abs(np.diff(path[20:42, 0])) / 0.05
    assert speed.max() < 2 * 0.2 / (20 * 0.05) * 1.2


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("clear", [0.005, 0.01])
def test_idle_fingertips_keep_clear_of_the_keys(side: str, clear: float) -> None:
    hand = HANDS[side]
    targets, weights, clearance = no_targets(30)
    clearance[:] = clear
    # One finger plays; without the clearance the others would come down with the hand.
    clearance[15:20, 2] = np.nan
    targets[15:20, 3] = [0.04, hand.points(HOME)[3, 1], WHITE_REST - 0.009]
    weights[15:20, 3] = 1 / 0.001
    path = smooth_path(PathProblem(hand, REST, targets, weights, clearance))
    points = np.array([hand.points(pose)[1:] for pose in path[5:]])
    idle = np.array([0, 1, 3, 4])
    above = points[:, idle, 2] - resting_height(points[:, idle, 0])
    # A wish, not a bound; but a key would not sound.
    assert above.min() > -0.006
    np.testing.assert_allclose(points[12:14, 2], targets[16:18, 3], atol=4e-3)


def test_hands_are_mirror_images() -> None:
    """Law: mirrored targets give the mirrored path."""
    draw = np.random.default_rng(5)
    targets, weights, clearance = no_targets(20)
    targets[:] = HANDS["rh"].points(HOME) + draw.normal(scale=0.01, size=(20, 6, 3))
    weights[::4, 1:] = 1 / 0.002
    clearance[:, 0] = 0.01
    right = smooth_path(PathProblem(HANDS["rh"], REST, targets, weights, clearance))
    left = smooth_path(
        PathProblem(HANDS["lh"], REST, targets * [1.0, -1.0, 1.0], weights, clearance)
    )
    left[:, 0] *= -1
    np.testing.assert_allclose(left, right, atol=1e-6)
