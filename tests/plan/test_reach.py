"""The table of reach agrees with the kinematics that it was made from, and is symmetric."""

from __future__ import annotations

import numpy as np
import pytest

from pianomime.keyboard import BLACK, KEYS
from pianomime.plan import LEFT, RIGHT
from pianomime.plan.joint_path import WHITE_REST, PathConfig, PathProblem, smooth_path
from pianomime.plan.reach import EASE, pair_limits, stretch
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres

NONE = KEYS


def test_the_order_of_the_two_fingers_makes_no_difference() -> None:
    table = stretch(RIGHT)
    np.testing.assert_array_equal(table, table.transpose(1, 0, 3, 2))


def test_a_finger_without_a_key_stretches_nothing() -> None:
    table = stretch(LEFT)
    assert (table[:, :, NONE] == 0).all()
    assert (table[:, :, :, NONE] == 0).all()


def test_hands_are_mirror_images() -> None:
    """Key k and key 82 - k mirror each other about D4, but for half a millimetre."""
    keys = np.arange(20, 63)
    right = stretch(RIGHT)[:, :, keys[:, None], keys]
    left = stretch(LEFT)[:, :, 82 - keys[:, None], 82 - keys]
    both = np.isfinite(right) & np.isfinite(left)
    np.testing.assert_allclose(left[both], right[both], atol=0.1)
    assert (np.isfinite(right) != np.isfinite(left)).mean() < 0.01


def test_an_octave_is_within_reach_and_a_twelfth_is_not() -> None:
    thumb, little = 0, 4
    assert stretch(RIGHT)[thumb, little, 39, 51] < 1
    assert np.isinf(stretch(RIGHT)[thumb, little, 39, 58])
    assert stretch(LEFT)[little, thumb, 39, 51] < 1


def test_fingers_at_ease_are_not_stretched() -> None:
    """Five neighbouring white keys lie under five fingers at ease, nearly."""
    keys = [39, 41, 43, 44, 46]
    table = stretch(RIGHT)
    assert max(table[a, b, keys[a], keys[b]] for a in range(5) for b in range(a)) < 0.25


@pytest.mark.parametrize(("low", "high"), [(0, 1), (0, 4), (1, 2), (3, 4)])
def test_inverse_kinematics_reach_the_limit_and_no_further(low: int, high: int) -> None:
    least, most = pair_limits(low, high, False, False)
    hand = Hand("rh")
    config = PathConfig(
        posture=30.0,
        slide_posture=1.0,
        coupling=0.5,
        damping=0.5,
        iterations=30,
        joint_acceleration=1e6,
        slide_acceleration=1e6,
    )

    def error(distance: float) -> float:
        """Distance [m] from the nearest of some places on white keys, when far apart."""
        best = np.inf
        for x in (0.030, 0.050, 0.070):
            for other in (0.030, 0.050, 0.070):
                targets, weights = np.zeros((2, 1, 6, 3))
                targets[0, 1 + low] = [x, -distance / 2, WHITE_REST - 0.009]
                targets[0, 1 + high] = [other, distance / 2, WHITE_REST - 0.009]
                weights[0, [1 + low, 1 + high]] = 1 / 0.0005
                clear = np.full((1, 5), np.nan)
                start = np.zeros(LAYOUT.hand_joints)
                path = smooth_path(PathProblem(hand, start, targets, weights, clear, config))
                off = (hand.points(path[1]) - targets[0])[[1 + low, 1 + high]]
                best = min(best, float(np.linalg.norm(off, axis=1).max()))
        return best

    for distance in (most, EASE[high] - EASE[low], least):
        assert error(distance) < 0.005
    for distance in (most + 0.012, least - 0.02):
        assert error(distance) > 0.003


def test_the_table_is_that_of_this_keyboard() -> None:
    along = key_centres()[:, 1]
    table = stretch(RIGHT)
    for a, b in ((39, 44), (40, 51), (44, 40)):
        least, most = pair_limits(1, 3, bool(BLACK[a]), bool(BLACK[b]))
        assert np.isfinite(table[1, 3, a, b]) == (least <= along[b] - along[a] <= most)
