"""What every player and every controller promises, those of the shipped weights included."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from pianomime import Demonstration, Player, Score, World, excerpt, load_player, songs
from pianomime.errors import InputError
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.players import player_names, rollout
from pianomime.policies.methods import METHODS, weight_files, weights_folder
from pianomime.track import PredictiveSamplingTracker, controls_per_frame

FRAMES = 16


def _shipped(name: str) -> bool:
    try:
        weight_files(name)
    except InputError:
        return False
    return True


PLAYERS = [name for name in player_names() if name not in METHODS or _shipped(name)]
PLAYERS.remove("expert")  # It is loaded by a folder; tests/learn has one.


@pytest.fixture(scope="module")
def score() -> Score:
    return excerpt(Score.from_midi(songs.path("beethoven-ode-to-joy")), seconds=3.0)


@dataclass
class Plans:
    """A tracker that starts what a player would, for predictive sampling to improve."""

    player: Player
    score: Score

    def start(self, plan: FingertipPlan):
        return self.player.start(self.score)


def load(name: str, score: Score, effort: int = 0, seed: int = 0) -> Player:
    shown = {}
    if name.startswith("demonstration"):
        shown = {"demonstration": Demonstration(score, ZeroShotPlanner().plan(score))}
    return load_player(name, effort, seed, **shown)


def test_every_shipped_weight_is_of_a_player_that_is_tested() -> None:
    shipped = {file.stem for file in weights_folder().glob("*.onnx")}
    assert shipped == {policy for name in PLAYERS if name in METHODS for policy in METHODS[name]}


def arrays(plan: FingertipPlan) -> list[np.ndarray]:
    return [plan.fingertips, plan.finger_key, plan.note_hand, plan.note_finger]


@pytest.mark.parametrize("name", PLAYERS)
def test_a_performance_is_whole_and_the_same_again(name: str, score: Score) -> None:
    first = load(name, score).play(score)
    assert first.player == name
    assert len(first) == score.frames()
    assert first.plan is not None
    assert len(first.plan) == score.frames()
    assert len(first.plan.note_hand) == len(score)
    assert first.metrics()["recall"] > 0.2
    again = load(name, score).play(score)
    np.testing.assert_array_equal(first.ctrl, again.ctrl)
    np.testing.assert_array_equal(first.qpos, again.qpos)
    for one, other in zip(arrays(first.plan), arrays(again.plan), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", PLAYERS)
def test_two_controllers_of_one_player_do_not_meet(name: str, score: Score) -> None:
    """All state is in the controller: songs may be played side by side, or begun and left."""
    player = load(name, score)
    alone = [step.ctrl for step in rollout(player.start(score), World(), np.zeros(FRAMES, bool))]
    other = player.start(score)
    controller, world = player.start(score), World()
    parts = controls_per_frame(controller)
    for number in range(FRAMES * parts):
        if number % 3 == 0:
            other.control(number // 3, World())
        ctrl = controller.control(number, world)
        np.testing.assert_array_equal(ctrl, np.atleast_2d(alone[number // parts])[number % parts])
        world.step(ctrl, parts=parts)


@pytest.mark.parametrize("name", PLAYERS)
def test_a_replayable_controller_may_be_asked_ahead_and_any_other_is_refused(
    name: str, score: Score
) -> None:
    player = load(name, score)
    controller, world = player.start(score), World()
    plan = controller.plan
    kept = [array.copy() for array in arrays(plan)]
    ahead = PredictiveSamplingTracker(Plans(player, score))
    parts = controls_per_frame(controller)
    if not controller.replayable:
        with pytest.raises(InputError, match="needs a replayable controller"):
            ahead.start(plan)
    else:
        if parts > 1:
            with pytest.raises(InputError, match=f"needs one control a frame, .* gives {parts}"):
                ahead.start(plan)
        else:
            ahead.start(plan).control(0, World())
        for frame in range(6):
            later = controller.control(frame + 4, world.copy())
            ctrl = controller.control(frame, world)
            np.testing.assert_array_equal(controller.control(frame, world.copy()), ctrl)
            np.testing.assert_array_equal(controller.control(frame + 4, world.copy()), later)
            world.step(ctrl, parts=parts)
    # A plan that somebody holds never changes.
    for one, other in zip(arrays(plan), kept, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", PLAYERS)
def test_the_world_is_left_as_it_was(name: str, score: Score) -> None:
    controller, world = load(name, score).start(score), World()
    before = world.state()
    controller.control(0, world)
    np.testing.assert_array_equal(world.state(), before)


@pytest.mark.parametrize("name", ["zero-shot", "zero-shot-20hz", "two-stage-diff"])
def test_another_seed_plays_another_way_where_anything_is_random(name: str, score: Score) -> None:
    effort = 1 if name.startswith("zero-shot") else 0
    hard = excerpt(Score.from_midi(songs.path("beethoven-fur-elise")), seconds=4.0)
    first, other = (load(name, hard, effort, seed).play(hard) for seed in (0, 1))
    assert not np.array_equal(first.ctrl, other.ctrl)
