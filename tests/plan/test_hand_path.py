from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pianomime.music import Score
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.plan.hand_path import hand_paths, make_feasible
from pianomime.world.parameters import key_centres


@pytest.fixture(scope="module")
def plan() -> FingertipPlan:
    """A plan that robot hands can do."""
    score = Score(
        [30, 34, 50, 53],
        [0.3, 0.6, 0.4, 0.9],
        [0.55, 1.0, 0.8, 1.3],
        np.full(4, 80),
        pedal=np.zeros((0, 2)),
        title="four",
    )
    return ZeroShotPlanner().plan(score)


def test_a_human_with_other_hands_is_settled_on_the_same_keys(plan: FingertipPlan) -> None:
    human = replace(plan, fingertips=plan.fingertips + [0.01, 0.006, 0.0])
    made = make_feasible(human)
    np.testing.assert_array_equal(made.finger_key, human.finger_key)
    frame, hand, finger = np.nonzero(made.finger_key >= 0)
    pressing = made.fingertips[frame, hand, finger + 1]
    key = made.finger_key[frame, hand, finger]
    np.testing.assert_allclose(pressing[:, 1], key_centres()[key, 1], atol=0.005)
    assert not pressing[:, 2].any()


def test_idle_hands_stay_about_where_the_humans_were(plan: FingertipPlan) -> None:
    # An octave to the side, and nothing to press.
    idle = replace(
        plan,
        fingertips=plan.fingertips + [0.0, 0.16, 0.0],
        finger_key=np.full_like(plan.finger_key, -1),
    )
    last = make_feasible(idle).fingertips[-1, :, 0, 1] - plan.fingertips[-1, :, 0, 1]
    np.testing.assert_allclose(last, 0.16, atol=0.02)


def test_paths_are_smooth(plan: FingertipPlan) -> None:
    moves = np.abs(np.diff(hand_paths(plan.finger_key)[:, :, 0, 1], axis=0))
    assert moves.max() < 0.08


def test_left_is_right_in_a_mirror(plan: FingertipPlan) -> None:
    """About a D, where the keyboard is its own mirror image."""
    keys = np.full((12, 2, 5), -1, np.int8)
    keys[4:9, 0, 1], keys[4:9, 1, 1] = 34, 48
    paths = hand_paths(keys)
    centre = 2 * key_centres()[41, 1]
    # Hands at rest are not the mirror images of each other about that D, so only where they press.
    np.testing.assert_allclose(paths[6:8, 0, 2, 1], centre - paths[6:8, 1, 2, 1], atol=0.002)
    np.testing.assert_allclose(paths[6:8, 0, 2, 0], paths[6:8, 1, 2, 0], atol=0.004)


def test_a_plan_that_is_made_feasible_has_no_joints_of_the_one_before() -> None:
    score = Score(
        np.array([40, 44]), np.array([0.0, 0.2]), np.array([0.2, 0.5]), np.array([64, 64])
    )
    plan = ZeroShotPlanner().plan(score)
    assert plan.joints is not None
    assert make_feasible(plan).joints is None
