from __future__ import annotations

import numpy as np
import pytest

from pianomime import Player
from pianomime.errors import InputError
from pianomime.music import Score
from pianomime.plan import ZeroShotPlanner
from pianomime.policies.features import base, from_wrists, to_world
from pianomime.policies.fingertip_policy import LearnedPlanner
from pianomime.policies.methods import METHODS, WEIGHTS
from pianomime.policies.policy_tracker import PolicyTracker
from pianomime.policies.two_stage import Generalist
from pianomime.world import World
from pianomime.world.parameters import key_centres

SCORE = Score([44, 25], [0.2, 0.4], [0.6, 0.8], [80, 80], pedal=np.zeros((0, 2)), title="two")


class Still:
    """Says that everything stays where it is, and keeps what it was shown."""

    def __init__(self, level):
        self.level, self.seen = level, []

    def say(self, seen, draw):
        self.seen.append(seen)
        if self.level == "high":
            return np.repeat(seen["vector"][:, None], 4, axis=1)
        return np.repeat(base(self.level, False, seen["vector"]), 4, axis=1)


class Pointing(Still):
    """Puts a finger near whatever is due."""

    def say(self, seen, draw):
        said = super().say(seen, draw).reshape(1, 4, 2, 6, 3)
        for key in np.flatnonzero(seen["goal"][0, 0]):
            hand = said[:, :, int(key > 40)]
            hand[..., 2, 1] = key_centres()[key, 1] + 0.005 - hand[..., 0, 1]
        return said.reshape(1, 4, 36)


def play(generalist):
    return Player("made up", generalist, generalist).play(SCORE)


def test_the_plan_that_is_kept_is_what_was_wanted_on_the_way():
    high, low = Pointing("high"), Still("low")
    performance = play(Generalist(PolicyTracker(low), high))
    plan = performance.plan
    np.testing.assert_array_equal(plan.keys(), SCORE.roll())
    assert plan.note_hand.tolist() == [1, 0]
    assert plan.note_finger.tolist() == [1, 1]
    frame, hand, finger = np.nonzero(plan.finger_key >= 0)
    key = plan.finger_key[frame, hand, finger]
    np.testing.assert_allclose(plan.fingertips[frame, hand, finger + 1, 1], key_centres()[key, 1])
    # The low level saw the same, for as far as it looks ahead.
    shown = low.seen[4]["frames"][0, 0, :36].reshape(2, 6, 3)
    np.testing.assert_allclose(shown, plan.fingertips[4], atol=1e-6)


def test_goals_ahead_end_in_silence():
    high = Pointing("high")
    performance = play(Generalist(PolicyTracker(Still("low")), high))
    roll = SCORE.roll()
    assert len(high.seen) == len(roll) == len(performance.plan)
    np.testing.assert_array_equal(high.seen[2]["goal"][0], roll[2:12].astype(float))
    assert not high.seen[-1]["goal"][0, 1:].any()


def test_a_policy_of_one_stage_plays_without_a_plan():
    low = Still("whole")
    performance = play(Generalist(PolicyTracker(low, fingertips=False), None))
    assert low.seen[0]["frames"].shape == (1, 4, 0)
    assert np.isfinite(performance.plan.fingertips).all()
    assert len(performance.plan) == SCORE.frames()


def test_the_same_seed_plays_the_same():
    first, again = (
        play(Generalist(PolicyTracker(Still("low")), Pointing("high"))) for _ in range(2)
    )
    np.testing.assert_array_equal(first.ctrl, again.ctrl)


@pytest.mark.parametrize("method", METHODS)
def test_without_weights_there_is_one_clear_line(method, tmp_path, monkeypatch):
    monkeypatch.setenv(WEIGHTS, str(tmp_path))
    with pytest.raises(InputError, match="pianomime train") as error:
        Player.from_name(method)
    assert "\n" not in str(error.value)


def test_a_follower_asked_twice_says_the_same():
    """So a tracker that looks ahead can improve it."""

    class Drawing(Still):
        def say(self, seen, draw):
            return super().say(seen, draw) + draw.normal(0, 0.1, (1, 4, 46))

    plan = ZeroShotPlanner().plan(SCORE)
    follower, world = PolicyTracker(Drawing("low")), World()
    follower.begin(plan)
    first = follower.control(3, world)
    follower.control(4, world)
    np.testing.assert_array_equal(follower.control(3, world), first)


def test_what_is_told_from_wrists_is_taken_back():
    points = np.random.default_rng(0).normal(size=(7, 2, 6, 3))
    np.testing.assert_allclose(to_world(from_wrists(points)), points)
    moved = from_wrists(points + [0.0, 0.3, 0.0])
    np.testing.assert_allclose(moved[:, :, 1:], from_wrists(points)[:, :, 1:])


def test_a_song_that_is_planned_ahead_is_what_would_be_wanted_on_the_way():
    ahead = LearnedPlanner(Pointing("high")).plan(SCORE)
    way = play(Generalist(PolicyTracker(Still("low")), Pointing("high"))).plan
    for name in ("fingertips", "finger_key", "note_hand", "note_finger"):
        np.testing.assert_array_equal(getattr(ahead, name), getattr(way, name))
