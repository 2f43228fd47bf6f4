"""The reward against values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pianomime.learn.envs.config import RewardConfig
from pianomime.learn.envs.reference import Reference
from pianomime.learn.envs.reward import (
    default_reward_terms,
    mimic_reward,
    press_reward,
    tolerance,
    weighted_rewards,
)
from pianomime.learn.envs.state import EnvState
from pianomime.plan import FingertipPlan


def keys(**state: float) -> NDArray[np.float64]:
    row = np.zeros((1, 88))
    for name, value in state.items():
        row[0, int(name[1:])] = value
    return row


def test_tolerance_is_one_within_the_bound_and_a_tenth_a_margin_beyond() -> None:
    distance = np.array([0.0, 0.05, 0.55, 0.30])
    got = tolerance(distance, 0.05, 0.5)
    np.testing.assert_allclose(got, [1.0, 1.0, 0.1, 0.1**0.25], rtol=1e-12)


@given(st.floats(0, 10), st.floats(0, 10))
def test_tolerance_never_rises(one: float, other: float) -> None:
    near, far = sorted((one, other))
    assert tolerance(np.array(near), 0.01, 0.05) >= tolerance(np.array(far), 0.01, 0.05)


@pytest.mark.parametrize(
    ("state", "sounds", "due", "wanted"),
    [
        # All that is due is down, nothing else.
        ({"k3": 1.0}, [3], [3], 1.0),
        # It is down, and so is another key.
        ({"k3": 1.0, "k4": 1.0}, [3, 4], [3], 0.5),
        # One of two is down; of the other half the way is missing, 0.45 beyond the bound.
        ({"k3": 1.0, "k9": 0.5}, [3], [3, 9], 0.5 * (1 + 0.1 ** (0.9**2)) / 2 + 0.5),
        # Nothing is due: the share for hits is not to be had.
        ({}, [], [], 0.5),
        ({"k3": 1.0}, [3], [], 0.0),
        # Down a little is not pressed, and costs nothing.
        ({"k3": 0.4}, [], [], 0.5),
    ],
)
def test_press_reward(
    state: dict[str, float], sounds: list[int], due: list[int], wanted: float
) -> None:
    pressed, goal = np.zeros((2, 1, 88), bool)
    pressed[0, sounds], goal[0, due] = True, True
    np.testing.assert_allclose(press_reward(keys(**state), pressed, goal, 0.5), [wanted])


def test_mimic_reward_looks_from_above() -> None:
    tips = np.zeros((1, 2, 5, 3))
    targets = tips.copy()
    targets[..., 2] = 0.045
    assert mimic_reward(tips, targets) == 1.0
    targets[0, 0, 0, :2] = 0.036, 0.048  # 0.06 away: a margin beyond the bound
    np.testing.assert_allclose(mimic_reward(tips, targets), (9 + 0.1) / 10)


def reward(
    config: RewardConfig,
    key_state: NDArray[np.float64],
    pressed: NDArray[np.bool_],
    goal: NDArray[np.bool_],
    targets: NDArray[np.float64],
    pedal: bool,
) -> float:
    """The sum of the terms in a frame in which the fingertips are at 0 and no pedal is wanted."""
    points = np.zeros((1, 2, 6, 3))
    points[:, :, 1:] = targets
    none = np.zeros(0, np.int8)
    plan = FingertipPlan(points, np.full((1, 2, 5), -1, np.int8), none, none)
    state = EnvState(
        reference=Reference(goal, np.array([False]), plan),
        frames=np.array([0]),
        joints=np.zeros((1, 54)),
        velocities=np.zeros((1, 54)),
        key_state=key_state,
        pressed=pressed,
        tips=np.zeros((1, 2, 5, 3)),
        pedal=np.array([pedal]),
        base_control=np.zeros((1, 46)),
        action=np.zeros((1, 46)),
    )
    return float(sum(weighted_rewards(default_reward_terms(config), state).values())[0])


def test_weights_are_those_of_table_3() -> None:
    pressed, goal = np.zeros((2, 1, 88), bool)
    goal[0, 3] = True
    near = np.zeros((1, 2, 5, 3))
    far = near + 1.0
    down = keys(k3=1.0)
    pressed[0, 3] = True
    config = RewardConfig()
    np.testing.assert_allclose(
        [
            reward(config, down, pressed, goal, near, False),
            reward(config, down, pressed, goal, far, False),
            reward(config, keys(), ~goal, goal, near, False),
        ],
        [1.0, 2 / 3, 1 / 3],
        atol=1e-2,
    )
    weighted = RewardConfig(press=0.0, mimic=0.0, pedal=0.25)
    assert reward(weighted, down, pressed, goal, far, False) == 0.25
    assert reward(weighted, down, pressed, goal, far, True) == 0.0
