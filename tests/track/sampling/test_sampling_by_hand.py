"""Predictive sampling against the same thing written down slowly, and its parts by hand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import KEYS, NO_KEY
from pianomime.plan import FingertipPlan
from pianomime.track import PredictiveSamplingConfig
from pianomime.track.heard import Frame
from pianomime.track.sampling.key_cost import KeyCost
from pianomime.track.sampling.predictive_sampling import PredictiveSamplingController
from pianomime.track.sampling.rollouts import Rollouts
from pianomime.track.sampling.variations import Variations
from pianomime.world import World
from pianomime.world.key_sensor import NOTHING
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres

FRAMES = 14
LEFT, RIGHT = 0, 1
INDEX, LITTLE = 1, 4
QUICK = PredictiveSamplingConfig(variations=5, rounds=2, commit=3, ahead=5, knots=2, seed=3)


def plan_of(presses: dict[tuple[int, int], int], along: float = 0.0) -> FingertipPlan:
    """Fingers (hand, finger) press their keys in all frames; all are over one place."""
    finger_key = np.full((FRAMES, 2, 5), NO_KEY, np.int8)
    for (hand, finger), key in presses.items():
        finger_key[:, hand, finger] = key
    points = np.zeros((FRAMES, 2, 6, 3))
    points[..., 1] = along
    nobody = np.empty(0, np.int8)
    return FingertipPlan(points, finger_key, nobody, nobody)


@dataclass
class Bowing:
    """A base controller that bends all joints more in each frame, and sees where they are."""

    plan: FingertipPlan
    replayable: ClassVar[bool] = True

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        return 0.03 * frame + 0.5 * world.qpos_hands[: LAYOUT.ctrl_size]


def controller(
    plan: FingertipPlan, config: PredictiveSamplingConfig = QUICK, goal: Any = None
) -> PredictiveSamplingController:
    base = Bowing(plan)
    goal = np.zeros((FRAMES, KEYS), bool) if goal is None else goal
    return PredictiveSamplingController(base, config, KeyCost(goal), goal)


def blamed(
    found: PredictiveSamplingController, frame: int, wrong: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """(46,) With which probability actuators are varied, by the keys (H, 88) that go wrong."""
    return found._variations.probabilities(frame, np.argwhere(wrong))


class Told:
    """A batch of worlds that is told what its keys do."""

    key_events = NOTHING

    def __init__(self, key_state: NDArray[np.float64], pressed: Any, blow_ups: Any) -> None:
        self.key_state, self.pressed = key_state, np.array(pressed)
        self.blow_ups, self.sounding = np.array(blow_ups), np.zeros_like(self.pressed)

    def set_state(self, state: Any, ids: Any) -> None:
        pass

    def step(self, ctrl: NDArray[np.float64], ids: Any) -> None:
        pass


@pytest.mark.parametrize(
    ("state", "pressed", "blow_ups", "per_frame"),
    [
        ({40: 0.9}, [40], 0, 0.1 * 0.1),  # right, and a tenth of the way short
        ({40: 0.4}, [], 0, 1 + 0.1 * 0.6),  # not pressed
        ({40: 1.0, 50: 0.8}, [40, 50], 0, 1 + 0.1 * 0.8),  # and a wrong one
        ({40: 1.0}, [40], 1, 0.0),  # right, but the physics broke once
    ],
)
def test_cost_counts_wrong_keys_a_tenth_of_what_is_missing_and_blow_ups(
    state: dict[int, float], pressed: list[int], blow_ups: int, per_frame: float
) -> None:
    goal, keys, down = np.zeros((3, KEYS), bool), np.zeros((1, KEYS)), np.zeros((1, KEYS), bool)
    goal[:, 40], down[0, pressed] = True, True
    keys[0, list(state)] = list(state.values())
    rollouts = Rollouts(KeyCost(goal), goal, 1, 1, "paper")
    start = rollouts.start(0, World(), [Frame([], down[0])] * 3)
    start = start._replace(batch=Told(keys, down, [blow_ups]))
    found = rollouts.best(start, np.zeros((1, 3, 1, LAYOUT.ctrl_size)))
    assert found.cost == pytest.approx(3 * per_frame + 100 * blow_ups)
    assert rollouts.steps == 3


@pytest.mark.parametrize("hand", [LEFT, RIGHT])
def test_mostly_the_finger_that_goes_wrong_is_varied(hand: int) -> None:
    config = replace(QUICK, blamed=0.7, arm=0.3, others=0.1)
    found = controller(plan_of({(hand, INDEX): 40, (1 - hand, LITTLE): 20}), config)
    wrong = np.zeros((5, KEYS), bool)
    wrong[2, 40] = True
    probability = blamed(found, 0, wrong)
    mine = np.full(LAYOUT.hand_actuators, 0.1)
    mine[LAYOUT.wrist_actuators] = mine[LAYOUT.slide_actuators] = 0.3
    mine[LAYOUT.finger_actuators[INDEX]] = 0.7
    np.testing.assert_array_equal(probability[LAYOUT.actuators[hand]], mine)
    assert not probability[LAYOUT.actuators[1 - hand]].any()
    # Both hands go wrong: neither takes away from the other.
    wrong[0, 20] = True
    both = blamed(found, 0, wrong)
    np.testing.assert_array_equal(both[LAYOUT.actuators[hand]], mine)
    assert (both[LAYOUT.actuators[1 - hand]][LAYOUT.finger_actuators[LITTLE]] == 0.7).all()
    assert not blamed(found, 0, np.zeros((5, KEYS), bool)).any()


def test_two_wrong_fingers_of_a_hand_are_both_varied() -> None:
    found = controller(plan_of({(RIGHT, INDEX): 40, (RIGHT, LITTLE): 47}))
    wrong = np.zeros((5, KEYS), bool)
    wrong[1, [40, 47]] = True
    mine = blamed(found, 0, wrong)[LAYOUT.actuators[RIGHT]]
    for finger, part in enumerate(LAYOUT.finger_actuators):
        wanted = QUICK.blamed if finger in (INDEX, LITTLE) else QUICK.others
        assert (mine[part] == wanted).all()


def test_a_key_that_nobody_should_press_is_blamed_on_the_nearest_finger() -> None:
    plan = plan_of({}, along=1.0)
    key, later = 60, 2
    plan.fingertips[later, LEFT, 1 + LITTLE, 1] = key_centres()[key, 1] + 0.01
    plan.fingertips[later, RIGHT, 1 + INDEX, 1] = key_centres()[key, 1] - 0.02
    plan.fingertips[0, RIGHT, 1 + INDEX, 1] = key_centres()[key, 1]
    # The wrist is nearest of all, but it is no fingertip.
    plan.fingertips[later, RIGHT, 0, 1] = key_centres()[key, 1]
    wrong = np.zeros((5, KEYS), bool)
    wrong[later - 1, key] = True
    probability = blamed(controller(plan), 1, wrong)
    mine = probability[LAYOUT.actuators[LEFT]][LAYOUT.finger_actuators[LITTLE]]
    assert (mine == QUICK.blamed).all()
    assert not probability[LAYOUT.actuators[RIGHT]].any()


def test_variations_are_linear_between_knots_and_as_large_as_they_should_be() -> None:
    config = PredictiveSamplingConfig(variations=6000, knots=4, ahead=8)
    probability = np.zeros(LAYOUT.ctrl_size)
    probability[[0, 5, 12]] = 1.0, 0.25, 1.0
    made = Variations(plan_of({}), config).draw(8, probability)
    assert made.shape == (6000, 8, LAYOUT.ctrl_size)
    assert not made[..., probability == 0].any()
    for first in (0, 4):
        bend = np.diff(made[:, first : first + 4], n=2, axis=1)
        np.testing.assert_allclose(bend, 0.0, atol=1e-12)
    assert np.abs(np.diff(made[:, 3:6, 0], n=2, axis=1)).max() > 0.01
    # An actuator of a variation is varied in all frames or in none.
    varied = (made[..., 5] != 0).mean(axis=0)
    np.testing.assert_allclose(varied, 0.25, atol=0.03)
    np.testing.assert_array_equal((made[..., 5] != 0).any(axis=1), (made[:, 0, 5] != 0))
    sizes = np.empty(LAYOUT.hand_actuators)
    sizes[:] = config.joint
    sizes[LAYOUT.wrist_actuators] = config.wrist
    sizes[LAYOUT.slide_actuators] = config.slide
    for knot in (0, 4):
        for actuator in (0, 12):
            size = made[:, knot, actuator].std()
            assert size == pytest.approx(sizes[actuator], rel=0.05)
            assert abs(made[:, knot, actuator].mean()) < 0.05 * sizes[actuator]
    assert np.corrcoef(made[:, 0, 0], made[:, 4, 0])[0, 1] == pytest.approx(0.0, abs=0.05)


def slowly(
    plan: FingertipPlan, config: PredictiveSamplingConfig, goal: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], int]:
    """The controls (T, 46) that are played, and the steps simulated ahead; one world at a time."""
    base, world = Bowing(plan), World()
    same = controller(plan, config, goal)  # for its random numbers alone
    played, steps = [], 0
    while len(played) < FRAMES:
        frame = len(played)
        horizon = range(frame, min(frame + config.ahead, FRAMES))
        ahead, best, wrong = world.copy(), [], []
        for each in horizon:
            best.append(base.control(each, ahead))
            ahead.step(best[-1])
            wrong.append(ahead.pressed != goal[each])
        steps += len(horizon)
        if np.any(wrong[: config.commit + 2]):
            probability = blamed(same, frame, np.array(wrong))
            for _ in range(config.rounds):
                varied = np.array(best) + same._variations.draw(len(horizon), probability)
                tries = [np.array(best), *varied[1:]]
                costs = []
                for one in tries:
                    other, cost = world.copy(), 0.0
                    for each, ctrl in zip(horizon, one, strict=True):
                        other.step(ctrl)
                        cost += (other.pressed != goal[each]).sum()
                        cost += 0.1 * np.abs(other.key_state - goal[each]).sum()
                    costs.append(cost)
                best = list(tries[int(np.argmin(costs))])
                steps += len(tries) * len(horizon)
        for ctrl in best[: config.commit][: FRAMES - frame]:
            world.step(ctrl)
            played.append(ctrl)
    return np.array(played), steps


@pytest.mark.parametrize(
    "config", [QUICK, replace(QUICK, rounds=1, commit=2, ahead=4, knots=3, variations=3)]
)
def test_it_is_what_is_written_down_slowly(config: PredictiveSamplingConfig) -> None:
    goal = np.zeros((FRAMES, KEYS), bool)
    goal[6:, [30, 44]] = True
    plan = plan_of({(LEFT, INDEX): 30, (RIGHT, LITTLE): 44})
    wanted, steps = slowly(plan, config, goal)
    # A hand that is simulated alone is the same but for a little.
    fast, world = controller(plan, replace(config, apart=9.0), goal), World()
    found = []
    for frame in range(FRAMES):
        found.append(fast.control(frame, world))
        world.step(found[-1])
    np.testing.assert_array_equal(found, wanted)
    assert FRAMES < fast.steps < steps


@pytest.mark.parametrize("name", ["variations", "rounds", "commit", "ahead", "knots"])
def test_budgets_are_one_or_more(name: str) -> None:
    assert getattr(PredictiveSamplingConfig(**{name: 1}), name) == 1
    with pytest.raises(InputError, match=f"{name} must be 1 or more"):
        PredictiveSamplingConfig(**{name: 0})


def test_efforts_are_ever_larger_budgets() -> None:
    budgets = [PredictiveSamplingConfig.of_effort(effort) for effort in (1, 2, 3)]
    work = [budget.variations * budget.rounds for budget in budgets]
    assert work == [32, 96, 384]
    assert all(replace(each, variations=16, rounds=2) == budgets[0] for each in budgets)
