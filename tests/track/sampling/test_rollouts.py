"""Roll-outs: the best of many is found though losers end early, and one hand may stand for both."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from heard import notes, plan_of
from pianomime.keyboard import FRAME_SECONDS, KEYS
from pianomime.plan import FingertipPlan
from pianomime.track import KeystrokeTracker
from pianomime.track.heard import Frame, strikes_in
from pianomime.track.sampling.note_cost import NoteCost, NoteCostConfig
from pianomime.track.sampling.perturbed_copies import COPIES
from pianomime.track.sampling.rollouts import Rollouts, keys_of
from pianomime.world import World
from pianomime.world.key_sensor import NOTHING
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres
from pianomime.world.perturbation import Perturbation
from pianomime.world.touch import TOUCHES

FIRST, FRAMES = 6, 5
APART = notes([20, 24, 60, 64], [0.0, 0.15, 0.0, 0.15])
"""The hands are far from each other."""
TOGETHER = notes([36, 40, 46, 49], [0.0, 0.15, 0.0, 0.15])
"""The hands are beside each other, and neither touches a key that the other one presses."""


@cache
def scene(
    apart: bool = True,
) -> tuple[FingertipPlan, World, NDArray[np.float64], list[Frame], NDArray[np.float64]]:
    """Some frames in which notes are played: the world before them, controls, what is heard."""
    plan = plan_of(APART if apart else TOGETHER)
    base, world = KeystrokeTracker().start(plan), World()
    for number in range(5 * FIRST):
        world.step(base.control(number, world), parts=5)
    ahead = world.copy()
    ctrl, heard, hands = [], [], []
    for frame in range(FIRST, FIRST + FRAMES):
        strikes = []
        for number in range(5 * frame, 5 * frame + 5):
            ctrl.append(base.control(number, ahead))
            ahead.step(ctrl[-1], parts=5)
            strikes += strikes_in(ahead.key_events, number * FRAME_SECONDS / 5)
        heard.append(Frame(strikes, ahead.pressed))
        hands.append(ahead.qpos_hands)
    return plan, world, np.array(ctrl).reshape(FRAMES, 5, 46), heard, np.array(hands)


def cost_of(plan: FingertipPlan) -> NoteCost:
    assert plan.strikes is not None
    return NoteCost(plan.strikes, plan.keys(), TOUCHES["goebl-bresin"], NoteCostConfig())


def rollouts(most: int, perturbation: Perturbation | None = None, apart: bool = True) -> Rollouts:
    plan = scene(apart)[0]
    return Rollouts(cost_of(plan), plan.keys(), most, 1, "paper", perturbation)


def varied(hand: int, count: int, apart: bool = True) -> NDArray[np.float64]:
    """Controls of which those of one hand vary, ever more."""
    _, _, ctrl, _, _ = scene(apart)
    more = np.zeros((count, 1, 1, LAYOUT.ctrl_size))
    drawn = np.random.default_rng(3).normal(0, 0.05, (count, 1, 1, LAYOUT.hand_actuators))
    more[..., LAYOUT.actuators[hand]] = drawn
    more[..., LAYOUT.actuators[hand]][..., LAYOUT.slide_actuators] = 0.0
    return ctrl + more


def test_losers_end_early_and_the_best_is_the_same() -> None:
    _, world, ctrl, known, _ = scene()
    tries = np.concatenate([ctrl[None], 4 * varied(1, 6) - 3 * ctrl])
    found = rollouts(7)
    start = found.start(FIRST, world, known)
    each = [rollouts(7).best(start._replace(batch=found._batch), one[None]) for one in tries]
    best = min(each, key=lambda one: one.cost)
    assert max(one.cost for one in each) > best.cost + 1, "some have to be worse"
    first = found.best(start, tries[:1])
    before = found.steps
    again = found.best(start, tries[1:], first)
    assert found.steps - before < 6 * FRAMES
    np.testing.assert_array_equal(again.ctrl, best.ctrl)
    assert again.cost == best.cost
    assert again.heard[-1].strikes == best.heard[-1].strikes
    # Of the same cost, what is known stays.
    assert found.best(start, again.ctrl[None], again) is again
    assert found.best(start, tries[:0], again) is again


def test_in_perturbed_copies_the_mean_cost_is_added_and_losers_are_not_rolled_out() -> None:
    _, world, ctrl, known, _ = scene()
    tries = np.concatenate([ctrl[None], 4 * varied(1, 6) - 3 * ctrl])
    nominal = rollouts(7)
    start = nominal.start(FIRST, world, known)
    copies = [(each, each.start(FIRST, world, known)) for each in map(rollouts, (7, 7), COPIES)]

    def apart(one: NDArray[np.float64]) -> float:
        there = [each.best(whence, one[None]).cost for each, whence in copies]
        return nominal.best(start, one[None]).cost + sum(there) / 2

    costs = [apart(one) for one in tries]
    assert max(costs) > min(costs) + 1, "some have to be worse"
    assert costs[0] != pytest.approx(2 * nominal.best(start, tries[:1]).cost), (
        "and worlds to differ"
    )
    first = nominal.best(start, tries[:1], copies=copies)
    assert first.cost == pytest.approx(costs[0])
    before = [each.steps for each, _ in copies]
    best = nominal.best(start, tries[1:], first, copies)
    assert best.cost == pytest.approx(min(costs))
    np.testing.assert_array_equal(best.ctrl, tries[int(np.argmin(costs))])
    for (each, _), steps in zip(copies, before, strict=True):
        assert each.steps - steps < 6 * FRAMES
    assert nominal.best(start, best.ctrl[None], best, copies) is best


@pytest.mark.parametrize("perturbation", [None, COPIES[0]])
@pytest.mark.parametrize("hand", [0, 1])
@pytest.mark.parametrize(("beside", "apart"), [(False, True), (True, True), (True, False)])
def test_one_hand_alone_is_heard_as_both_are(
    hand: int, beside: bool, apart: bool, perturbation: Perturbation | None
) -> None:
    _, world, ctrl, known, hands = scene(apart)
    found = rollouts(4, perturbation, apart)
    start = found.start(FIRST, world, known)
    # What both do there is what the other hand does while one is varied.
    start = start._replace(known=found.best(start, ctrl[None]).heard)
    keys = keys_of(hand, hands, 0.1)
    assert (keys is not None) == apart
    if beside:
        alone = found.start_beside(start, hand, ctrl)
    else:
        assert keys is not None
        alone = found.start_alone(start, hand, keys)
    assert found.alone == beside * FRAMES
    before, before_alone = found.steps, found.alone
    for one in (ctrl, *varied(hand, 3, apart)):
        both, mine = found.best(start, one[None]), found.best(alone, one[None])
        for whole, part in zip(both.heard, mine.heard, strict=True):
            np.testing.assert_array_equal(part.pressed, whole.pressed)
            wanted, heard = sorted(whole.strikes), sorted(part.strikes)
            assert [strike.key for strike in heard] == [strike.key for strike in wanted]
            np.testing.assert_allclose(
                [strike.time for strike in heard],
                [strike.time for strike in wanted],
                atol=2e-3,
            )
        assert mine.cost == pytest.approx(both.cost, abs=0.02)
    assert any(frame.strikes for frame in mine.heard)
    assert found.alone - before_alone == 4 * FRAMES
    assert found.steps - before == 8 * FRAMES


def test_keys_are_parted_half_way_between_the_hands() -> None:
    hands = scene()[4]
    low, high = (keys_of(hand, hands, 0.05) for hand in (0, 1))
    assert low is not None
    np.testing.assert_array_equal(low, ~high)
    assert low[[20, 24]].all()
    assert not low[[60, 64]].any()
    assert (np.diff(key_centres()[low, 1]) > 0).all()
    assert keys_of(0, hands, 1.0) is None
    together = hands.copy()
    for index, sign in ((0, 1), (1, -1)):
        together[:, LAYOUT.among_hands(index)][:, LAYOUT.slide] += 0.25 * sign
    assert keys_of(1, together, 0.05) is None


class Told:
    """A batch of worlds that is told what its keys do."""

    def __init__(self, key_state: NDArray[np.float64], blow_ups: list[int]) -> None:
        self.key_state, self.blow_ups = key_state, np.array(blow_ups)
        self.pressed = np.zeros(key_state.shape, bool)
        self.sounding = np.zeros(key_state.shape, bool)
        self.key_events = NOTHING

    def set_state(self, state: NDArray[np.float64], ids: NDArray[np.int64]) -> None:
        pass

    def step(self, ctrl: NDArray[np.float64], ids: NDArray[np.int64]) -> None:
        pass


@pytest.mark.parametrize(
    ("down", "broken", "cost"), [(0.0, 0, 0.0), (0.4, 0, 2 * 0.01 * 0.4), (0.0, 1, 100.0)]
)
def test_keys_on_their_way_and_broken_physics_cost(down: float, broken: int, cost: float) -> None:
    state, world = np.zeros((1, KEYS)), World()
    state[0, 40] = down
    found, nothing = rollouts(1), Frame([], np.zeros(KEYS, bool))
    found._batch = told = Told(state, [broken])
    world.sounding[[20, 30]] = True
    # In the lead-in, in which no key should be down.
    start = found.start(0, world, [nothing, nothing])
    outcome = found.best(start, np.zeros((1, 2, 5, 46)))
    assert outcome.cost == pytest.approx(cost)
    assert len(outcome.heard) == 2
    # A key that sounds does not sound again before it has come back.
    np.testing.assert_array_equal(told.sounding, [world.sounding])
