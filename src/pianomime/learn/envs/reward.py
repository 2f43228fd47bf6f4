"""The reward of one frame (paper, table 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.learn.expert.config import RewardConfig

KEY_BOUND, KEY_MARGIN = 0.05, 0.5
"""Shares of a key's way down that count as none missing, and over which the reward falls to 0.1."""
TIP_BOUND, TIP_MARGIN = 0.01, 0.05
"""[m] The same for a fingertip's distance from its target, seen from above."""

_AT_MARGIN = 0.1


def tolerance(distance: NDArray[np.float64], bound: float, margin: float) -> NDArray[np.float64]:
    """The function g of table 3: 1 up to the bound, falling as a Gaussian to 0.1 a margin beyond.

    Args:
        distance: any shape, 0 or more.
        bound: up to where nothing is lost, in the unit of the distance.
        margin: from there to where 0.1 is left.
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
    """(B,) 0..1 for the right keys down, and only those.

    Args:
        key_state: (B, 88) how far each key is down, 0..1.
        pressed: (B, 88) whether it sounds.
        goal: (B, 88) whether it should.
        hit: share of the keys that are due; nothing of it is had where none is. The rest is for
            no other key being pressed.
    """
    due = goal.sum(axis=1)
    down = np.where(goal, tolerance(1.0 - key_state, KEY_BOUND, KEY_MARGIN), 0.0).sum(axis=1)
    clean = ~(pressed & ~goal).any(axis=1)
    reward: NDArray[np.float64] = hit * down / np.maximum(due, 1) + (1.0 - hit) * clean
    return reward


def mimic_reward(tips: NDArray[np.float64], targets: NDArray[np.float64]) -> NDArray[np.float64]:
    """(B,) 0..1 for fingertips (B, 2, 5, 3) [m] over their targets (B, 2, 5, 3) [m].

    Heights do not count: a target's z says whether a key is to be pressed.
    """
    distance = np.sqrt(((tips - targets)[..., :2] ** 2).sum(axis=-1))
    reward: NDArray[np.float64] = tolerance(distance, TIP_BOUND, TIP_MARGIN).mean(axis=(1, 2))
    return reward


def frame_reward(
    config: RewardConfig,
    key_state: NDArray[np.float64],
    pressed: NDArray[np.bool_],
    goal: NDArray[np.bool_],
    tips: NDArray[np.float64],
    targets: NDArray[np.float64],
    pedal_right: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """(B,) the weighted sum; arguments as above, and whether the pedal (B,) is as it should be."""
    return (
        config.press * press_reward(key_state, pressed, goal, config.hit)
        + config.mimic * mimic_reward(tips, targets)
        + config.pedal * pedal_right
    )
