"""Feedback of fingertips, by hand and on the hands themselves."""

from __future__ import annotations

import numpy as np
import pytest

from pianomime.track.finger_feedback import lift_joints, reach_joints, shared
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT

JOINTS = LAYOUT.hand_joints


@pytest.fixture(scope="module")
def jacobian() -> np.ndarray:
    """(5, 3, 27) of fingertips that are a little bent, without the arm."""
    pose = np.zeros(JOINTS)
    pose[LAYOUT.arm_joints :] = 0.3
    _, found = Hand("rh").points_and_jacobian(pose)
    made = found[1:].copy()
    made[..., : LAYOUT.arm_joints] = 0.0
    return made


@pytest.mark.parametrize("finger", range(5))
def test_a_finger_moves_towards_where_it_should_be_and_the_others_stay(
    finger: int, jacobian: np.ndarray
) -> None:
    error = np.zeros((5, 3))
    error[finger] = [0.001, -0.002, 0.003]
    move = reach_joints(jacobian, error, 0.02, 0.001)
    reached = jacobian @ move
    assert reached[finger] @ error[finger] > 0.8 * error[finger] @ error[finger]
    np.testing.assert_allclose(np.delete(reached, finger, axis=0), 0.0, atol=1e-12)
    # More damping moves less.
    slower = reach_joints(jacobian, error, 0.02, 0.03)
    assert np.linalg.norm(slower) < np.linalg.norm(move)


def test_errors_are_clipped_to_a_length(jacobian: np.ndarray) -> None:
    error = np.tile([0.0, 0.03, 0.04], (5, 1))
    found = reach_joints(jacobian, error, 0.02, 0.03)
    np.testing.assert_allclose(found, reach_joints(jacobian, 0.4 * error, 1.0, 0.03))
    small = 0.1 * error
    np.testing.assert_allclose(
        reach_joints(jacobian, small, 0.02, 0.03), reach_joints(jacobian, small, 1.0, 0.03)
    )
    assert not reach_joints(jacobian, np.zeros((5, 3)), 0.02, 0.03).any()


def test_a_lift_goes_up(jacobian: np.ndarray) -> None:
    upward = jacobian[[1, 3], 2]
    rises = upward @ lift_joints(upward, 0.01)
    assert ((rises > 0.005) & (rises <= 0.01)).all()
    assert not lift_joints(upward[:0], 0.01).any()
    # Joints that hardly raise the finger do not move without bound.
    assert np.abs(lift_joints(1e-6 * upward, 0.01)).max() < 1e-3


def test_what_striking_fingers_have_in_common_is_left_to_the_forearm() -> None:
    assert shared(np.array([])) == 0
    assert shared(np.array([0.004])) == pytest.approx(0.002)
    assert shared(np.array([0.004, -0.004])) == 0
    assert shared(np.full(4, 0.005)) == pytest.approx(0.004)
