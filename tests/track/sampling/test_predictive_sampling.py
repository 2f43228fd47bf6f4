import warnings
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime import load_player
from pianomime.errors import InputError
from pianomime.music import Score, frame_metrics
from pianomime.plan import LEFT, FingertipPlan, ZeroShotPlanner
from pianomime.players import rollout
from pianomime.track import (
    DynamicTracker,
    PredictiveSamplingConfig,
    PredictiveSamplingTracker,
    Tracker,
)
from pianomime.track.sampling import predictive_sampling
from pianomime.world import World
from pianomime.world.layout import LAYOUT

QUICK = PredictiveSamplingConfig(variations=12)


@pytest.fixture(scope="module")
def score() -> Score:
    """Leaps in both hands, too quick for one pass to hit them all."""
    key = np.array([20, 60, 39, 70, 25, 58, 40, 66, 22, 63, 37, 72])
    onset = np.repeat(np.arange(6), 2) * 0.25
    return Score(key, onset, onset + 0.2, np.full(12, 64))


@pytest.fixture(scope="module")
def plan(score: Score) -> FingertipPlan:
    return ZeroShotPlanner().plan(score)


def follow(tracker: Tracker, plan: FingertipPlan) -> tuple[NDArray[np.float64], float]:
    world = World()
    ctrl, pressed = [], []
    for step in rollout(tracker.start(plan), world, np.zeros(len(plan), bool)):
        ctrl.append(step.ctrl)
        pressed.append(world.pressed)
    return np.array(ctrl), frame_metrics(plan.keys(), np.array(pressed)).f1


def test_hits_more_keys_than_the_tracker_alone(plan: FingertipPlan) -> None:
    _, alone = follow(DynamicTracker(), plan)
    _, helped = follow(PredictiveSamplingTracker(DynamicTracker(), QUICK), plan)
    assert alone < 0.99, "the passage has to be hard for the test to say anything"
    assert helped > alone


def test_same_plan_same_controls_also_the_second_time(plan: FingertipPlan) -> None:
    tracker = PredictiveSamplingTracker(DynamicTracker(), QUICK)
    first, _ = follow(tracker, plan)
    again, _ = follow(tracker, plan)
    np.testing.assert_array_equal(first, again)


def test_leaves_alone_what_goes_well(plan: FingertipPlan) -> None:
    silent = FingertipPlan(
        plan.fingertips + [0.0, 0.0, 0.05],
        np.full_like(plan.finger_key, -1),
        plan.note_hand,
        plan.note_finger,
    )
    plain, _ = follow(DynamicTracker(), silent)
    helped, _ = follow(PredictiveSamplingTracker(DynamicTracker(), QUICK), silent)
    np.testing.assert_array_equal(plain, helped)


def test_the_world_is_left_as_it_was(plan: FingertipPlan) -> None:
    tracker, world = PredictiveSamplingTracker(DynamicTracker(), QUICK), World()
    controller = tracker.start(plan)
    before = world.state()
    controller.control(0, world)
    np.testing.assert_array_equal(world.state(), before)


def test_more_effort_simulates_more(plan: FingertipPlan) -> None:
    steps = []
    for effort in (1, 2):
        config = PredictiveSamplingConfig.of_effort(effort)
        controller = PredictiveSamplingTracker(DynamicTracker(), config).start(plan)
        for _ in rollout(controller, World(), np.zeros(16, bool)):
            pass
        steps.append(controller.steps)
    assert steps[1] > steps[0]


def test_a_controller_with_a_memory_is_refused_in_one_line(plan: FingertipPlan) -> None:
    nested = PredictiveSamplingTracker(PredictiveSamplingTracker(DynamicTracker(), QUICK), QUICK)
    with pytest.raises(InputError, match="needs a replayable controller") as error:
        nested.start(plan)
    assert "\n" not in str(error.value)


def test_a_goal_shorter_than_the_plan_is_refused_in_one_line(plan: FingertipPlan) -> None:
    tracker = PredictiveSamplingTracker(DynamicTracker(), QUICK, goal=plan.keys()[1:])
    with pytest.raises(InputError, match=f"the plan has {len(plan)}$"):
        tracker.start(plan)


@pytest.mark.parametrize("effort", [-1, 4])
def test_no_such_effort(effort: int) -> None:
    with pytest.raises(InputError, match="effort must be"):
        load_player("zero-shot", effort)


def test_an_imagined_disaster_is_no_warning(plan: FingertipPlan) -> None:
    wild = PredictiveSamplingConfig(variations=8, joint=50.0, wrist=50.0, slide=5.0)
    controller = PredictiveSamplingTracker(DynamicTracker(), wild).start(plan)
    world = World()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for frame in range(12):
            world.step(controller.control(frame, world))
    assert world.blow_ups == 0


def test_hands_that_do_not_pass_through_each_other_are_simulated_together_when_near(
    plan: FingertipPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(predictive_sampling, "SOLID_APART", 1.0)  # however they are, it is near
    alone = []
    for world in ("paper", "solid"):
        config = replace(QUICK, variations=3, rounds=1)
        tracker = PredictiveSamplingTracker(DynamicTracker(world=world), config, world=world)
        controller, there = tracker.start(plan), World(world)
        varied = np.zeros(LAYOUT.ctrl_size)
        varied[LAYOUT.actuators[LEFT]] = 1.0
        known = controller._look.frames(0, 4, there)
        start = controller._rollouts.start(0, there, [step.frame for step in known])
        controller._vary(known, [start], varied)
        alone.append(controller.steps_alone)
    assert alone[0] > 0 == alone[1]
