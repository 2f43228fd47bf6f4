"""The paper's inverse kinematics: the least of its squares, and what it plays."""

from __future__ import annotations

from pathlib import Path

import daqp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from pianomime.music import frame_metrics
from pianomime.plan import FingertipPlan
from pianomime.players import rollout
from pianomime.track import IkConfig, IkTracker
from pianomime.track.ik import bounded_least_squares
from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.model import SIDES

JOINTS = 27
ROWS = 18
SEEDS = st.integers(0, 2**32 - 1)
HANDS = {side: Hand(side) for side in SIDES}


def objective(
    x: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    error: NDArray[np.float64],
    damping: float,
) -> float:
    return float(((jacobian @ x - error) ** 2).sum() + damping * (x @ x))


def assert_least(
    x: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    error: NDArray[np.float64],
    damping: float,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> None:
    """A step downhill, cut off at the box, leads nowhere (Karush, Kuhn and Tucker)."""
    assert ((low <= x) & (x <= high)).all()
    slope = jacobian.T @ (jacobian @ x - error) + damping * x
    downhill = x - slope / ((jacobian**2).sum(axis=0) + damping)
    np.testing.assert_allclose(np.clip(downhill, low, high), x, atol=1e-7)


def program(seed: int, worst: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Jacobian (18, 27) whose rows weigh from 1 down to `worst`, and an error (18,)."""
    draw = np.random.default_rng(seed)
    weights = np.geomspace(1.0, worst, ROWS)[:, None]
    return weights * draw.normal(size=(ROWS, JOINTS)), weights[:, 0] * draw.normal(size=ROWS)


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, room=st.sampled_from([1e-3, 0.1, 10.0]), damping=st.sampled_from([1e-6, 1.0]))
def test_is_the_least_of_the_squares(seed: int, room: float, damping: float) -> None:
    jacobian, error = program(seed, 1e-2)
    draw = np.random.default_rng(seed + 1)
    low, high = -room * draw.uniform(size=JOINTS), room * draw.uniform(size=JOINTS)
    x = bounded_least_squares(jacobian, error, damping, low, high)
    assert_least(x, jacobian, error, damping, low, high)
    rows = np.vstack([jacobian, np.sqrt(damping) * np.eye(JOINTS)])
    other = lsq_linear(rows, np.r_[error, np.zeros(JOINTS)], (low, high), tol=1e-14).x
    least = objective(other, jacobian, error, damping)
    assert objective(x, jacobian, error, damping) <= least * (1 + 1e-6) + 1e-12


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, worst=st.sampled_from([1e-4, 1e-8, 1e-16]))
def test_bears_badly_conditioned_programs_at_the_limits(seed: int, worst: float) -> None:
    """The published solver gave up on such: weights 1e16 apart, joints at their limits."""
    jacobian, error = program(seed, worst)
    draw = np.random.default_rng(seed + 1)
    low = np.where(draw.random(JOINTS) < 0.4, 0.0, -1.0)
    high = np.where(draw.random(JOINTS) < 0.4, 0.0, 1.0)
    x = bounded_least_squares(1e4 * jacobian, 1e4 * error, 1e-6, low, high)
    assert np.isfinite(x).all()
    assert ((low <= x) & (x <= high)).all()
    stay = objective(np.zeros(JOINTS), jacobian, error, 1e-14)
    assert objective(x, jacobian, error, 1e-14) <= stay * (1 + 1e-9)


def test_nowhere_to_go() -> None:
    jacobian, error = program(0, 1.0)
    x = bounded_least_squares(jacobian, error, 1e-6, np.zeros(JOINTS), np.zeros(JOINTS))
    np.testing.assert_array_equal(x, np.zeros(JOINTS))


@pytest.mark.parametrize("side", SIDES)
@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, at_limits=st.floats(0, 1))
def test_step_stays_in_limits_and_improves(side: str, seed: int, at_limits: float) -> None:
    """Seen from where it starts, a step of least squares never makes the weighted error larger."""
    hand, draw = HANDS[side], np.random.default_rng(seed)
    qpos = draw.uniform(hand.low, hand.high)
    stuck = draw.random(JOINTS) < at_limits
    qpos[stuck] = np.where(draw.random(JOINTS) < 0.5, hand.low, hand.high)[stuck]
    points, jacobian = hand.points_and_jacobian(qpos)
    target = points + draw.normal(scale=0.02, size=(6, 3))
    there = IkTracker().step(hand, qpos, target)
    assert ((hand.low - 1e-12 <= there) & (there <= hand.high + 1e-12)).all()
    expected = points + jacobian @ (there - qpos)
    before, after = (np.linalg.norm((where - target)[1:]) for where in (points, expected))
    # The wrist counts a thousandth of a fingertip.
    assert after <= before + 1e-3 * abs(target - points)[0, 1]


@pytest.mark.parametrize("side", SIDES)
def test_first_step_of_a_song_from_rest(side: str) -> None:
    """At rest most finger joints are at a limit: where the published solver failed."""
    hand = HANDS[side]
    rest = np.zeros(JOINTS)
    target = hand.points(rest)
    target[1:, 2] = 0.045
    there = IkTracker().step(hand, rest, target)
    assert np.isfinite(there).all()
    assert ((hand.low <= there) & (there <= hand.high)).all()


@pytest.mark.parametrize("side", SIDES)
def test_stays_where_the_targets_are(side: str) -> None:
    hand = HANDS[side]
    qpos = hand.low + 0.4 * (hand.high - hand.low)
    there = IkTracker().step(hand, qpos, hand.points(qpos))
    np.testing.assert_allclose(there, qpos, atol=1e-9)


@pytest.mark.parametrize("side", SIDES)
def test_repeated_steps_arrive(side: str) -> None:
    """Targets that a pose reaches are reached, to a fraction of a millimetre."""
    hand = HANDS[side]
    tracker = IkTracker()
    goal = hand.points(hand.low + 0.45 * (hand.high - hand.low))
    qpos = hand.low + 0.35 * (hand.high - hand.low)
    for _ in range(30):
        qpos = tracker.step(hand, qpos, goal)
    assert np.abs((hand.points(qpos) - goal)[1:]).max() < 5e-4


def test_published_weights() -> None:
    config = IkConfig()
    assert (config.tip_weight, config.damping, config.lm_damping) == (1e4, 1e-6, 1e-6)
    assert config.wrist_weight == (1e-8, 10.0, 1e-12)


def test_controls_are_the_next_joint_positions() -> None:
    """Right hand before left, the two end joints of a finger as their sum."""
    tracker, world = IkTracker(), World()
    fingertips = world.fingertips[None] + [0.0, 0.0, -0.01]
    none = np.empty(0, np.int8)
    idle = np.full((1, 2, 5), -1, np.int8)
    ctrl = tracker.start(FingertipPlan(fingertips, idle, none, none)).control(0, world)
    assert ctrl.shape == (46,)
    for hand, target in zip(HANDS.values(), fingertips[0], strict=True):
        there = tracker.step(hand, world.qpos[hand.joints], target)
        np.testing.assert_array_equal(ctrl[hand.actuators], hand.to_ctrl @ there)


def test_plays_stan_as_published(shared: Path) -> None:
    """The published open loop: precision 0.80, recall 0.68, F1 0.69."""
    with np.load(shared / "data" / "stan" / "reference.npz") as file:
        fingertips, finger_key, goal = (file[k] for k in ("fingertips", "finger_key", "goal"))
    none = np.empty(0, np.int8)
    world = World()
    controller = IkTracker().start(FingertipPlan(fingertips, finger_key, none, none))
    pressed = np.empty_like(goal)
    for step in rollout(controller, world, np.zeros(len(goal), bool)):
        pressed[step.frame] = world.pressed
    played = frame_metrics(goal, pressed)
    assert played.precision == pytest.approx(0.80, abs=0.03)
    assert played.recall == pytest.approx(0.68, abs=0.03)
    assert played.f1 == pytest.approx(0.69, abs=0.03)
    assert world.blow_ups == 0


def test_a_slower_solver_helps_out(monkeypatch: pytest.MonkeyPatch) -> None:
    jacobian, error = program(3, 1e-2)
    low, high = np.full(JOINTS, -0.05), np.full(JOINTS, 0.05)
    low[3] = high[3] = 0.02
    fast = bounded_least_squares(jacobian, error, 1e-3, low, high)
    monkeypatch.setattr(daqp, "solve", lambda *_: (np.full(JOINTS, np.nan), 0.0, -1, {}))
    slow = bounded_least_squares(jacobian, error, 1e-3, low, high)
    np.testing.assert_allclose(slow, fast, atol=1e-5)
