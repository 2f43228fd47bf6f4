"""Note sampling: what it is worth, what it leaves alone, and the same thing written down slowly."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from heard import listen, notes, plan_of, play, scale
from pianomime.errors import InputError
from pianomime.keyboard import FRAME_SECONDS
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.track import (
    KeystrokeConfig,
    KeystrokeTracker,
    NoteSamplingConfig,
    NoteSamplingTracker,
    controls_per_frame,
)
from pianomime.track.heard import Frame, strikes_in
from pianomime.track.keystroke import KeystrokeController
from pianomime.track.sampling.note_cost import NoteCost, NoteCostConfig
from pianomime.track.sampling.perturbed_copies import COPIES
from pianomime.track.sampling.variations import Variations
from pianomime.track.strokes import StrokeConfig
from pianomime.world import World
from pianomime.world.touch import TOUCHES

PLAIN = KeystrokeTracker()
QUICK = NoteSamplingConfig(variations=4, commit=2, ahead=4, knots=2, seed=3)
NOTES_ALONE = NoteCostConfig(late=0.0, touch=0.0, frame=0.0)


@cache
def leaps(seed: int) -> Score:
    """Six leaps a second of each hand, too quick to hit all."""
    draw = np.random.default_rng(seed)
    key = np.append(draw.integers(20, 38, 12), draw.integers(42, 64, 12))
    return notes(key, np.tile(np.arange(12) * 0.16, 2), 0.13)


@cache
def plan_of_leaps(seed: int) -> FingertipPlan:
    return plan_of(leaps(seed))


def sampling(config: NoteSamplingConfig | None = None) -> NoteSamplingTracker:
    return NoteSamplingTracker(PLAIN, config, threads=1)


def test_fewer_notes_are_missed_and_fewer_struck_that_nobody_wanted() -> None:
    faults = []
    for tracker in (PLAIN, sampling()):
        heard = [listen(tracker, plan_of_leaps(seed), leaps(seed)) for seed in range(1, 7)]
        faults.append(sum(each.missed + each.phantoms for each in heard))
    assert faults[0] >= 6, "the passages have to be hard for the test to say anything"
    assert faults[1] <= 0.6 * faults[0]


def test_where_nothing_is_wrong_the_base_is_followed_bit_for_bit() -> None:
    plan = plan_of(scale().clip(0, 2.0))
    controller = sampling(NoteSamplingConfig(cost=NOTES_ALONE)).start(plan)
    ctrl, heard = play(controller)
    alone, heard_alone = play(PLAIN.start(plan))
    np.testing.assert_array_equal(ctrl, alone)
    assert heard == heard_alone
    # What was looked ahead is kept: each frame was simulated once.
    assert controller.steps == len(plan)


@pytest.mark.parametrize("copies", [0, 1])
def test_same_plan_same_controls_also_the_second_time_and_others_with_another_seed(
    copies: int,
) -> None:
    config = replace(QUICK, copies=copies)
    plan, tracker = plan_of(leaps(5).clip(0, 1.3)), sampling(config)
    first, again = (play(tracker.start(plan))[0] for _ in range(2))
    np.testing.assert_array_equal(first, again)
    threads = NoteSamplingTracker(PLAIN, config, threads=2)
    np.testing.assert_array_equal(play(threads.start(plan))[0], first)
    assert not np.array_equal(play(sampling(replace(config, seed=4)).start(plan))[0], first)


def test_world_and_plan_are_left_as_they_were() -> None:
    plan, world = plan_of_leaps(5), World()
    kept = plan.fingertips.copy(), plan.finger_key.copy(), plan.strikes.onset.copy()
    controller = sampling(QUICK).start(plan)
    assert controller.plan is plan
    assert not controller.replayable
    assert controls_per_frame(controller) == 5
    before = world.state()
    for number in range(5):
        controller.control(number, world)
    np.testing.assert_array_equal(world.state(), before)
    now = plan.fingertips, plan.finger_key, plan.strikes.onset
    for one, other in zip(now, kept, strict=True):
        np.testing.assert_array_equal(one, other)


def test_one_hand_is_simulated_where_it_alone_is_varied_and_far_from_the_other() -> None:
    both = QUICK, replace(QUICK, apart=100.0)
    near, never = (sampling(config).start(plan_of_leaps(5)) for config in both)
    heard = [play(controller)[1] for controller in (near, never)]
    assert 0 < near.steps_alone < near.steps
    assert never.steps_alone == 0
    wanted = len(leaps(5))
    missed = [abs(wanted - len(each)) for each in heard]
    assert missed[0] <= missed[1] + 3


def test_more_effort_simulates_more() -> None:
    steps = []
    for effort in (1, 2):
        config = replace(NoteSamplingConfig.of_effort(effort), variations=2)
        controller = sampling(config).start(plan_of_leaps(5))
        play(controller)
        steps.append(controller.steps)
    assert steps[1] > 1.5 * steps[0]


def test_efforts_are_ever_larger_budgets() -> None:
    budgets = [NoteSamplingConfig.of_effort(effort) for effort in (1, 2, 3)]
    work = [budget.variations * budget.rounds for budget in budgets]
    assert work == sorted(set(work))
    alike = {"variations": budgets[0].variations, "rounds": budgets[0].rounds}
    assert all(replace(each, **alike) == budgets[0] for each in budgets)


def test_an_even_touch_is_wanted_where_strokes_are_even() -> None:
    """Else it would vary all that is played as it is to be."""
    score = scale(velocity=np.where(np.arange(14) % 2, 120, 20)).clip(0, 1.6)
    plan = plan_of(score)
    even = KeystrokeTracker(KeystrokeConfig(stroke=StrokeConfig(even=True)))
    cost = NoteCostConfig(late=0.0, frame=0.0, touch=1.0, notice=1.2)
    config = replace(QUICK, cost=cost, trigger=100.0)
    controller = NoteSamplingTracker(even, config, threads=1).start(plan)
    np.testing.assert_array_equal(play(controller)[0], play(even.start(plan))[0])
    assert controller.steps == len(plan)


def follow(
    base: KeystrokeController, world: World, frames: range
) -> tuple[NDArray[np.float64], list[Frame]]:
    """What a controller does in a world: controls (H, S, 46), and what is heard."""
    ctrl, heard = [], []
    for frame in frames:
        strikes = []
        for number in range(5 * frame, 5 * frame + 5):
            ctrl.append(base.control(number, world))
            world.step(ctrl[-1], parts=5)
            strikes += strikes_in(world.key_events, number * FRAME_SECONDS / 5)
        heard.append(Frame(strikes, world.pressed))
    return np.array(ctrl).reshape(-1, 5, 46), heard


def roll_out(
    world: World, frames: range, ctrl: NDArray[np.float64], goal: NDArray[np.bool_]
) -> tuple[list[Frame], float]:
    """What is heard of controls (H, S, 46) in a world, and what keys on their way cost."""
    heard, short = [], 0.0
    for frame, target in zip(frames, ctrl, strict=True):
        world.step(target)
        heard.append(Frame(strikes_in(world.key_events, frame * FRAME_SECONDS), world.pressed))
        short += 0.01 * np.abs(world.key_state - goal[frame]).sum()
    return heard, short


def restored(world: World) -> World:
    """A world in the same state, whose keys are all awake, as those of roll-outs are."""
    other = World(world.model, quiet=True)
    other.set_state(world.state())
    other.sounding = world.sounding.copy()
    return other


def slowly(plan: FingertipPlan, config: NoteSamplingConfig) -> tuple[NDArray[np.float64], int]:
    """The controls (T, S, 46) that are played, and how often any were varied."""
    base, goal = PLAIN.start(plan), plan.keys()
    worlds = [World(), *(World(each.model()) for each in COPIES[: config.copies])]
    costs = [NoteCost(base.strikes, goal, TOUCHES["goebl-bresin"], config.cost) for _ in worlds]
    variations = Variations(plan, config)
    played: list[NDArray[np.float64]] = []
    varied = 0
    while len(played) < len(plan):
        first = len(played)
        frames = range(first, min(first + config.ahead, len(plan)))
        best, _ = follow(base, worlds[0].copy(), frames)
        wrong = []
        for world, cost in zip(worlds, costs, strict=True):
            start = world.copy() if world is worlds[0] else restored(world)
            heard, _ = roll_out(start, frames, best, goal)
            value, soon = cost.of(first, heard, min(config.commit + 2, len(frames)))
            _, later = cost.of(first, heard, len(frames))
            if later and (soon or value >= config.trigger):
                wrong += later
        if wrong:
            varied += 1
            probability = variations.probabilities(first, wrong)
            for _ in range(config.rounds):
                drawn = variations.draw(len(frames), probability, 5).reshape(-1, *best.shape)
                tries = [best, *(best + drawn[1:])]
                value_of = []
                for each in tries:
                    values = []
                    for world, cost in zip(worlds, costs, strict=True):
                        heard, short = roll_out(restored(world), frames, each, goal)
                        values.append(cost.of(first, heard, len(frames))[0] + short)
                    copies = sum(values[1:]) / len(values[1:]) if config.copies else 0.0
                    value_of.append(values[0] + copies)
                best = tries[int(np.argmin(value_of))]
        for frame, ctrl in zip(frames[: config.commit], best, strict=False):
            for world, cost in zip(worlds, costs, strict=True):
                world.step(ctrl)
                cost.heard(strikes_in(world.key_events, frame * FRAME_SECONDS))
            played.append(ctrl)
    return np.array(played), varied


@pytest.mark.parametrize(
    "config",
    [
        replace(QUICK, cost=NoteCostConfig(notice=0.02)),
        replace(QUICK, rounds=1, commit=1, ahead=5, trigger=0.05, cost=NoteCostConfig(notice=0.1)),
        replace(QUICK, copies=2, variations=3, cost=NoteCostConfig(notice=0.02)),
    ],
    ids=["a little wrong", "costs a little", "perturbed copies"],
)
def test_it_is_what_is_written_down_slowly(config: NoteSamplingConfig) -> None:
    plan = plan_of(leaps(5).clip(0, 1.0))
    config = replace(config, apart=100.0)
    wanted, varied = slowly(plan, config)
    assert varied > 2
    found, _ = play(sampling(config).start(plan))
    np.testing.assert_array_equal(found.reshape(wanted.shape), wanted)


@pytest.mark.parametrize("name", ["variations", "rounds", "commit", "ahead", "knots"])
def test_budgets_are_one_or_more(name: str) -> None:
    assert getattr(NoteSamplingConfig(**{name: 1}), name) == 1
    with pytest.raises(InputError, match=f"{name} must be 1 or more"):
        NoteSamplingConfig(**{name: 0})


@pytest.mark.parametrize("copies", [-1, len(COPIES) + 1, 0.5])
def test_there_are_so_many_copies_and_no_more(copies: float) -> None:
    assert NoteSamplingConfig(copies=len(COPIES)).copies == len(COPIES)
    with pytest.raises(InputError, match="copies must be"):
        NoteSamplingConfig(copies=copies)  # type: ignore[arg-type]


def test_a_plan_without_strikes_is_refused_in_one_line() -> None:
    plan = replace(plan_of_leaps(5), strikes=None)
    with pytest.raises(InputError, match="has no strikes") as error:
        sampling().start(plan)
    assert "\n" not in str(error.value)
