"""The reward: a weighted sum of named terms (paper, table 3)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.envs.config import RewardConfig
from pianomime.learn.envs.state import EnvState
from pianomime.world.parameters import key_centres

KEY_BOUND, KEY_MARGIN = 0.05, 0.5
"""Shares of a key's way down: what may be missing at no loss, and over which the reward then falls
to 0.1."""
TIP_BOUND, TIP_MARGIN = 0.01, 0.05
"""[m] The same for a fingertip's distance from its target, seen from above."""
REACH_BOUND, REACH_MARGIN = 0.005, 0.15
"""[m] The same for the way from a goal key to the nearest fingertip."""

_AT_MARGIN = 0.1


@dataclass(frozen=True)
class RewardTerm:
    """A named part of the reward.

    Attributes:
        name: unique among the terms of an environment.
        func: from the state of n environments after a frame to the values (n,).
        weight: the values are multiplied by it; negative for a penalty.
    """

    name: str
    func: Callable[[EnvState], NDArray[np.generic]]
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not self.name:
            raise InputError("a reward term needs a name")
        if not math.isfinite(self.weight):
            raise InputError(
                f"reward term {self.name!r}: weight must be finite, not {self.weight:g}"
            )


def default_reward_terms(config: RewardConfig) -> tuple[RewardTerm, ...]:
    """The terms of table 3 that have a weight other than 0: press, mimic, pedal, in this order."""
    terms = (
        RewardTerm("press", partial(_press, hit=config.hit), config.press),
        RewardTerm("mimic", _mimic, config.mimic),
        RewardTerm("pedal", _pedal, config.pedal),
    )
    return tuple(term for term in terms if term.weight)


def check_reward_terms(terms: Sequence[RewardTerm]) -> tuple[RewardTerm, ...]:
    """The terms, if they can be told apart.

    Raises:
        InputError: two of them have the same name.
    """
    names = [term.name for term in terms]
    if len(set(names)) < len(names):
        raise InputError(f"reward terms must have different names, not {', '.join(names)}")
    return tuple(terms)


def weighted_rewards(
    terms: Sequence[RewardTerm], state: EnvState
) -> dict[str, NDArray[np.float64]]:
    """(n,) of each term by name, times its weight; the reward is their sum in this order.

    Args:
        terms: of the reward.
        state: of n environments after the frame that was played.

    Raises:
        ValueError: a term gives values of another shape than (n,).
    """
    rewards: dict[str, NDArray[np.float64]] = {}
    for term in terms:
        values = np.asarray(term.func(state))
        if values.shape != (len(state),):
            raise ValueError(
                f"reward term {term.name!r} must have the shape {(len(state),)}, not {values.shape}"
            )
        rewards[term.name] = term.weight * values.astype(np.float64, copy=False)
    return rewards


def tolerance(distance: NDArray[np.float64], bound: float, margin: float) -> NDArray[np.float64]:
    """The function g of table 3: 1 up to the bound, then a Gaussian that is 0.1 a margin beyond.

    Args:
        distance: any shape, 0 or more.
        bound: distance up to which nothing is lost.
        margin: distance from there to where 0.1 is left.
    """
    beyond = np.maximum(distance - bound, 0.0) / margin
    near: NDArray[np.float64] = np.exp(np.log(_AT_MARGIN) * beyond**2)
    return near


def press_reward(
    key_state: NDArray[np.float64],
    pressed: NDArray[np.bool_],
    goal: NDArray[np.bool_],
    hit: float,
) -> NDArray[np.float64]:
    """(B,) 0..1 for pressing the goal keys and no others.

    Args:
        key_state: (B, 88) how far each key is down, 0..1.
        pressed: (B, 88) bool, the keys that sound.
        goal: (B, 88) bool, the keys that should.
        hit: share for how far the goal keys are down, 0 in a frame without any. The rest is for
            no other key being pressed.
    """
    due = goal.sum(axis=1)
    down = np.where(goal, tolerance(1.0 - key_state, KEY_BOUND, KEY_MARGIN), 0.0).sum(axis=1)
    clean = ~(pressed & ~goal).any(axis=1)
    reward: NDArray[np.float64] = hit * down / np.maximum(due, 1) + (1.0 - hit) * clean
    return reward


def mimic_reward(tips: NDArray[np.float64], targets: NDArray[np.float64]) -> NDArray[np.float64]:
    """(B,) 0..1 for fingertips over their targets.

    Heights do not count: a target's z says whether a key is to be pressed.

    Args:
        tips: (B, 2, 5, 3) fingertips [m].
        targets: (B, 2, 5, 3) where they should be [m].
    """
    distance = np.sqrt(((tips - targets)[..., :2] ** 2).sum(axis=-1))
    reward: NDArray[np.float64] = tolerance(distance, TIP_BOUND, TIP_MARGIN).mean(axis=(1, 2))
    return reward


def reach_reward(tips: NDArray[np.float64], goal: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(B,) 0..1 for a fingertip at each goal key; 1 in a frame without any.

    Only the way along the keyboard counts. Any finger will do, as with the fingers that RP1M finds
    (Zhao et al., 2024), but one may serve several keys.

    Args:
        tips: (B, 2, 5, 3) fingertips [m].
        goal: (B, 88) bool, the keys that should sound.
    """
    along = tips[..., 1].reshape(len(tips), -1)
    away = np.abs(along[:, None] - key_centres()[:, 1, None]).min(axis=2)
    near = tolerance(away, REACH_BOUND, REACH_MARGIN)
    due = goal.sum(axis=1)
    reward: NDArray[np.float64] = np.where(goal, near, 0.0).sum(axis=1) / np.maximum(due, 1)
    return np.where(due > 0, reward, 1.0)


def _press(state: EnvState, hit: float) -> NDArray[np.float64]:
    return press_reward(state.key_state, state.pressed, state.goal, hit)


def _mimic(state: EnvState) -> NDArray[np.float64]:
    return mimic_reward(state.tips, state.targets)


def _pedal(state: EnvState) -> NDArray[np.bool_]:
    right: NDArray[np.bool_] = state.pedal == state.pedal_goal
    return right
