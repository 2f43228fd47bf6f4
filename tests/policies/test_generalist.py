from __future__ import annotations

import numpy as np
import pytest

from pianomime import excerpt, load_player, songs
from pianomime.errors import InputError
from pianomime.music import Score
from pianomime.plan import ZeroShotPlanner
from pianomime.players import rollout
from pianomime.players.generalist import GeneralistPlayer, PredictionConfig
from pianomime.policies.features import action_reference, relative_to_wrist, to_world_frame
from pianomime.policies.methods import METHODS, WEIGHTS
from pianomime.policies.policy_tracker import PolicyTracker
from pianomime.policies.predicted_plan import misfit, predicted_plan
from pianomime.world import World
from pianomime.world.parameters import key_centres

SCORE = Score([44, 25], [0.2, 0.4], [0.6, 0.8], [80, 80], pedal=np.zeros((0, 2)), title="two")
SONGS = ("beethoven-fur-elise", "petzold-minuet-g", "twinkle-twinkle")


class Still:
    """A policy that keeps everything where it is, and its observations."""

    def __init__(self, level):
        self.level, self.observations = level, []

    def act(self, observation, rng):
        self.observations.append(observation)
        if self.level == "high":
            return np.repeat(observation["vector"][:, None], 4, axis=1)
        return np.repeat(action_reference(self.level, False, observation["vector"]), 4, axis=1)


class Pointing(Still):
    """Puts a finger near whatever is due."""

    def act(self, observation, rng):
        action = super().act(observation, rng).reshape(-1, 4, 2, 6, 3)
        for key in np.flatnonzero(observation["goal"][0, 0]):
            hand = action[:, :, int(key > 40)]
            hand[..., 2, 1] = key_centres()[key, 1] + 0.005 - hand[..., 0, 1]
        return action.reshape(-1, 4, 36)


def play(low, high=None, feasible=False):
    tracker = PolicyTracker(low, fingertips=high is not None)
    return GeneralistPlayer("made up", tracker, high, prediction=PredictionConfig(feasible)).play(
        SCORE
    )


def test_the_plan_that_is_kept_is_what_was_wanted_on_the_way():
    high, low = Pointing("high"), Still("low")
    performance = play(low, high)
    plan = performance.plan
    np.testing.assert_array_equal(plan.keys(), SCORE.roll())
    assert plan.note_hand.tolist() == [1, 0]
    assert plan.note_finger.tolist() == [1, 1]
    frame, hand, finger = np.nonzero(plan.finger_key >= 0)
    key = plan.finger_key[frame, hand, finger]
    np.testing.assert_allclose(plan.fingertips[frame, hand, finger + 1, 1], key_centres()[key, 1])
    # The low level saw the same, for as far as it looks ahead.
    shown = low.observations[4]["frames"][0, 0, :36].reshape(2, 6, 3)
    np.testing.assert_allclose(shown, plan.fingertips[4], atol=1e-6)


def test_goals_ahead_end_in_silence():
    high = Pointing("high")
    performance = play(Still("low"), high)
    roll = SCORE.roll()
    assert len(high.observations) == len(roll) == len(performance.plan)
    np.testing.assert_array_equal(high.observations[2]["goal"][0], roll[2:12].astype(float))
    assert not high.observations[-1]["goal"][0, 1:].any()


def test_a_policy_of_one_stage_plays_without_a_plan():
    low = Still("whole")
    performance = play(low)
    assert low.observations[0]["frames"].shape == (1, 4, 0)
    assert np.isfinite(performance.plan.fingertips).all()
    assert len(performance.plan) == SCORE.frames()


def test_the_same_seed_plays_the_same():
    first, again = (play(Still("low"), Pointing("high")) for _ in range(2))
    np.testing.assert_array_equal(first.ctrl, again.ctrl)


@pytest.mark.parametrize("method", METHODS)
def test_without_weights_there_is_one_clear_line(method, tmp_path, monkeypatch):
    monkeypatch.setenv(WEIGHTS, str(tmp_path))
    with pytest.raises(InputError, match="pianomime train") as error:
        load_player(method)
    assert "\n" not in str(error.value)


def test_a_policy_controller_asked_twice_answers_the_same():
    """So predictive sampling can improve it."""

    class Sampling(Still):
        def act(self, observation, rng):
            return super().act(observation, rng) + rng.normal(0, 0.1, (1, 4, 46))

    controller = PolicyTracker(Sampling("low")).start(ZeroShotPlanner().plan(SCORE))
    world = World()
    assert controller.replayable
    first = controller.control(3, world)
    controller.control(4, world)
    np.testing.assert_array_equal(controller.control(3, world), first)


def test_a_plan_that_somebody_holds_does_not_grow():
    player = GeneralistPlayer(
        "made up",
        PolicyTracker(Still("low")),
        Pointing("high"),
        prediction=PredictionConfig(feasible=False),
    )
    controller, world = player.start(SCORE), World()
    early = controller.plan
    kept = early.finger_key.copy()
    for _ in rollout(controller, world, SCORE.pedal_roll()):
        pass
    np.testing.assert_array_equal(early.finger_key, kept)
    assert (controller.plan.finger_key >= 0).any()


def test_what_is_told_from_wrists_is_taken_back():
    points = np.random.default_rng(0).normal(size=(7, 2, 6, 3))
    np.testing.assert_allclose(to_world_frame(relative_to_wrist(points)), points)
    moved = relative_to_wrist(points + [0.0, 0.3, 0.0])
    np.testing.assert_allclose(moved[:, :, 1:], relative_to_wrist(points)[:, :, 1:])


def test_a_song_that_is_planned_ahead_is_what_would_be_wanted_on_the_way():
    ahead = predicted_plan(SCORE, Pointing("high"))
    way = play(Still("low"), Pointing("high")).plan
    for name in ("fingertips", "finger_key", "note_hand", "note_finger"):
        np.testing.assert_array_equal(getattr(ahead, name), getattr(way, name))


class Wandering(Pointing):
    """As often as not, one hand of a candidate is far from its keys."""

    def act(self, observation, rng):
        action = super().act(observation, rng).reshape(-1, 4, 2, 6, 3)
        away = rng.random((len(action), 2)) < 0.5
        action[:, :, :, 0, 1] += 0.4 * away[:, None]
        return action.reshape(-1, 4, 36)


def test_of_several_candidates_the_one_that_fits_goes_on():
    given = [
        (predicted_plan(SCORE, Wandering("high"), seed, candidates).finger_key >= 0).sum()
        for candidates in (1, 16)
        for seed in range(4)
    ]
    assert np.mean(given[4:]) > np.mean(given[:4]) + 1
    assert np.max(given[4:]) <= SCORE.roll().sum()


def test_candidates_that_are_alike_change_nothing():
    alone, four = (predicted_plan(SCORE, Pointing("high"), 0, number) for number in (1, 4))
    np.testing.assert_array_equal(alone.fingertips, four.fingertips)
    np.testing.assert_array_equal(alone.finger_key, four.finger_key)


def test_what_does_not_fit_is_counted_in_keys():
    points = np.zeros((2, 6, 3))
    keys, goal = np.full((2, 5), -1, np.int8), np.zeros(88, bool)
    goal[[40, 44]] = True
    assert misfit(points, keys, goal) == 2, "two keys without a finger"
    keys[1, [1, 3]] = 40, 44
    points[1, [2, 4], 1] = key_centres()[[40, 44], 1] + 0.1
    assert misfit(points, keys, goal) == 0, "a hand that is beside them as it is"
    points[1, 4, 1] += 0.02
    assert misfit(points, keys, goal) == pytest.approx(2 * (0.01 - 0.005) / 0.01), "drawn apart"


def test_players_choose_among_as_many_candidates_as_they_are_told():
    def pressed(number):
        high = Wandering("high")
        tracker = PolicyTracker(Still("low"))
        config = PredictionConfig(candidates=number)
        player = GeneralistPlayer("made up", tracker, high, prediction=config)
        player.start(SCORE)
        return {len(observation["vector"]) for observation in high.observations}

    assert [pressed(number) for number in (1, 3)] == [{1}, {3}]


@pytest.mark.parametrize("number", [0, 1.5, 17])
def test_candidates_out_of_range_are_refused(number):
    with pytest.raises(InputError, match=r"planner\.candidates"):
        PredictionConfig(candidates=number)


def test_predicted_fingers_keep_their_keys_where_hands_can_be():
    raw = predicted_plan(SCORE, Pointing("high"))
    feasible = play(Still("low"), Pointing("high"), feasible=True).plan
    for name in ("finger_key", "note_hand", "note_finger"):
        np.testing.assert_array_equal(getattr(feasible, name), getattr(raw, name))
    assert not np.allclose(feasible.fingertips, raw.fingertips)
    np.testing.assert_array_equal(feasible.fingertips[..., 2], raw.fingertips[..., 2])


def test_feasible_fingertips_are_played_better():
    means = []
    for feasible in (True, False):
        player = load_player("two-stage-diff", 0, planner={"feasible": feasible})
        scores = [excerpt(Score.from_midi(songs.path(name)), seconds=10) for name in SONGS]
        means.append(np.mean([player.play(score).metrics()["f1"] for score in scores]))
    assert means[0] > means[1] + 0.02


def test_the_low_level_sees_all_goals_also_those_that_nobody_was_given():
    high, low = Still("high"), Still("low")
    play(low, high, feasible=True)
    roll = np.vstack([SCORE.roll(), np.zeros((4, 88), bool)])
    for frame, observation in enumerate(low.observations):
        np.testing.assert_array_equal(observation["goal"][0], roll[frame : frame + 4])


def test_only_players_of_two_stages_predict_fingertips():
    with pytest.raises(InputError, match=r"there is no setting 'planner\.feasible'"):
        load_player("bc-mse", 0, planner={"feasible": False})
