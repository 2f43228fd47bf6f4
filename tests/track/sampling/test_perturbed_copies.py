"""Perturbed copies: they are what a replay is, and what was tried in them goes better there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from heard import notes, plan_of, play
from pianomime.keyboard import FRAME_SECONDS
from pianomime.plan import FingertipPlan
from pianomime.track import KeystrokeTracker, NoteSamplingConfig, NoteSamplingTracker
from pianomime.track.heard import Frame, strikes_in
from pianomime.track.sampling.note_cost import NoteCost, NoteCostConfig
from pianomime.track.sampling.perturbed_copies import COPIES, PerturbedCopy
from pianomime.track.sampling.predictive_sampling import PredictiveSamplingController
from pianomime.world import World
from pianomime.world.perturbation import Perturbation, PerturbedWorld
from pianomime.world.touch import TOUCHES
from pianomime.world_names import PAPER

CONFIG = NoteSamplingConfig(variations=6, commit=2, ahead=4, knots=2)


def leaps(seed: int, count: int = 8) -> FingertipPlan:
    """Three leaps a second of each hand."""
    draw = np.random.default_rng(seed)
    key = np.append(draw.integers(20, 38, count), draw.integers(42, 64, count))
    return plan_of(notes(key, np.tile(np.arange(count) * 0.3, 2), 0.2))


def sampling(plan: FingertipPlan, copies: int) -> PredictiveSamplingController:
    config = replace(CONFIG, copies=copies)
    return NoteSamplingTracker(KeystrokeTracker(), config, threads=1).start(plan)


def cost_of(plan: FingertipPlan) -> NoteCost:
    assert plan.strikes is not None
    return NoteCost(plan.strikes, plan.keys(), TOUCHES["goebl-bresin"], NoteCostConfig())


def replayed(plan: FingertipPlan, ctrl: NDArray[np.float64], world: World) -> float:
    """What controls (T * 5, 46) cost in a world, which is left as it is at the end."""
    heard = []
    for frame, target in enumerate(ctrl.reshape(len(plan), 5, -1)):
        world.step(target)
        heard.append(Frame(strikes_in(world.key_events, frame * FRAME_SECONDS), world.pressed))
    return cost_of(plan).of(0, heard, len(heard))[0]


def test_controls_cost_less_in_the_copies_than_those_of_one_world() -> None:
    plan, costs = leaps(3), []
    for copies in (0, 2):
        ctrl, _ = play(sampling(plan, copies))
        costs.append([replayed(plan, ctrl, PerturbedWorld(copy)) for copy in COPIES[:2]])
    assert sum(costs[0]) > 4, "something has to go wrong there"
    assert sum(costs[1]) < 0.6 * sum(costs[0])


def test_a_copy_is_where_the_replay_leads() -> None:
    plan = leaps(3, 2)
    controller = sampling(plan, 3)
    ctrl, _ = play(controller)
    states = []
    for copy, perturbation in zip(controller.copies, COPIES, strict=True):
        world = PerturbedWorld(perturbation)
        replayed(plan, ctrl, world)
        np.testing.assert_array_equal(copy.world.state(), world.state())
        assert not any(np.array_equal(world.state(), other) for other in states)
        states.append(world.state())


@pytest.mark.parametrize(
    ("perturbation", "differs"), [(Perturbation(), False), (Perturbation(keys_aside=0.012), True)]
)
def test_what_goes_well_is_varied_only_where_it_does_not_in_a_copy(
    perturbation: Perturbation, differs: bool
) -> None:
    plan = plan_of(notes([40], [0.2]))
    expected, _ = play(sampling(plan, 0))
    controller = sampling(plan, 0)
    copy = PerturbedCopy(perturbation, PAPER, cost_of(plan), plan.keys(), CONFIG.variations, 1)
    controller.copies.append(copy)
    found, _ = play(controller)
    assert np.array_equal(found, expected) != differs


def test_what_is_simulated_in_copies_is_counted() -> None:
    plan = plan_of(notes([40], [0.2]))
    alone, controller = sampling(plan, 0), sampling(plan, 0)
    copy = PerturbedCopy(Perturbation(), PAPER, cost_of(plan), plan.keys(), CONFIG.variations, 1)
    controller.copies.append(copy)
    play(alone)
    play(controller)
    # Nothing is varied: the copy looks ahead as often as is chosen, and follows.
    frames = len(plan)
    ahead = sum(min(CONFIG.ahead, frames - first) for first in range(0, frames, CONFIG.commit))
    assert alone.steps == frames
    assert controller.steps == alone.steps + ahead + frames
