"""The zero-shot planner: whole plans of any score."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from any_score import chord, melody, score_of, scores
from pianomime.keyboard import NO_KEY
from pianomime.music import Score
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.songs.find import find_song
from pianomime.world.hand import Hand
from pianomime.world.model import SIDES
from pianomime.world.parameters import key_centres


def empty() -> Score:
    return Score(np.array([], int), np.array([]), np.array([]), np.array([], int))


def check(score: Score, plan: FingertipPlan) -> None:
    """What holds of the plan of any score."""
    roll = score.roll()
    assert len(plan) == len(roll)
    assert plan.note_hand.shape == plan.note_finger.shape == (len(score),)
    assert (plan.keys() <= roll).all()
    assert np.isfinite(plan.fingertips).all()
    # A finger at z = 0 presses; every other one is in the air.
    pressing = plan.finger_key != NO_KEY
    np.testing.assert_array_equal(plan.fingertips[:, :, 1:, 2] == 0.0, pressing)
    # No key is pressed by two fingers.
    assert pressing.sum() == plan.keys().sum()
    for note, (first, end) in enumerate(score.note_frames()):
        if plan.note_hand[note] >= 0 and first < end:
            finger = plan.finger_key[first:end, plan.note_hand[note], plan.note_finger[note]]
            assert (finger == score.key[note]).any()


@settings(max_examples=20, deadline=None)
@given(score=scores())
def test_laws_of_any_plan(score: Score) -> None:
    check(score, ZeroShotPlanner().plan(score))


@pytest.mark.parametrize("song", ["bach-prelude-c", "beethoven-fur-elise", "satie-gymnopedie-1"])
def test_laws_of_plans_of_songs(song: str) -> None:
    score = Score.from_midi(find_song(song)).clip(0.0, 6.0)
    plan = ZeroShotPlanner().plan(score)
    check(score, plan)
    assert plan.dropped <= 0.05 * len(score)


@pytest.mark.parametrize(
    "score",
    [
        chord([40], 0, 0),
        chord([40], 0, 1),
        chord(list(range(40, 52))),
        chord(list(range(88)), 0, 2),
        score_of((40, 0, 3), (40, 3, 6), (40, 6, 9)),
        score_of((40, 0, 9), (40, 2, 4), (41, 2, 2)),
    ],
    ids=["no length", "one frame", "cluster", "all keys", "repeated", "overlapping"],
)
def test_laws_of_odd_plans(score: Score) -> None:
    check(score, ZeroShotPlanner().plan(score))


def test_nothing_to_play() -> None:
    plan = ZeroShotPlanner().plan(empty())
    check(empty(), plan)
    assert plan.dropped == 0
    assert not plan.keys().any()


def test_a_cluster_of_twelve_drops_two_or_more() -> None:
    plan = ZeroShotPlanner().plan(chord(list(range(40, 52))))
    assert 2 <= plan.dropped < 12


def test_pressing_fingers_are_over_their_keys() -> None:
    plan = ZeroShotPlanner().plan(melody([39, 41, 43, 44, 46], frames=8))
    frame, hand, finger = np.nonzero(plan.finger_key != NO_KEY)
    keys = plan.finger_key[frame, hand, finger]
    tips = plan.fingertips[frame, hand, finger + 1]
    assert np.abs(tips[:, 1] - key_centres()[keys, 1]).max() < 0.006
    assert (np.abs(tips[:, 0]) < 0.075).all()


def test_is_deterministic() -> None:
    score = melody([39, 41, 43, 44, 46])
    one, other = (ZeroShotPlanner().plan(score) for _ in range(2))
    np.testing.assert_array_equal(one.fingertips, other.fingertips)
    np.testing.assert_array_equal(one.finger_key, other.finger_key)


def test_the_joints_of_a_plan_have_its_points() -> None:
    plan = ZeroShotPlanner().plan(Score.from_midi(find_song("bach-prelude-c")).clip(0.0, 4.0))
    assert plan.joints is not None
    for index, side in enumerate(SIDES):
        points = Hand(side).points_along(plan.joints[:, index])
        idle = plan.finger_key[:, index] == NO_KEY
        np.testing.assert_array_equal(points[:, 0], plan.fingertips[:, index, 0])
        np.testing.assert_array_equal(points[:, 1:][idle], plan.fingertips[:, index, 1:][idle])
        # Of a finger that presses, a plan says that it does, and not how deep it goes.
        np.testing.assert_array_equal(points[..., :2], plan.fingertips[:, index, :, :2])
