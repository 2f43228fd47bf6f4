"""Variations of controls: smooth random additions, mostly to the fingers that go wrong."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.plan import FingertipPlan
from pianomime.validation import finite, whole_numbers, within
from pianomime.world.hand import by_actuator
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres


@dataclass(frozen=True)
class VariationConfig:
    """The distribution of the variations."""

    variations: int = 16
    """Variations that are rolled out side by side."""
    knots: int = 4
    """Frames between the knots of a variation, which is linear between them."""
    joint: float = 0.2
    """Standard deviation of variations of the fingers' actuators [rad]."""
    wrist: float = 0.06
    """Standard deviation of variations of the wrists' actuators [rad]."""
    slide: float = 0.006
    """Standard deviation of variations of the forearms' slides [m]."""
    blamed: float = 0.7
    """Probability that an actuator of a finger that goes wrong is varied."""
    arm: float = 0.3
    """Probability that an actuator of its wrist and forearm is varied."""
    others: float = 0.1
    """Probability that an actuator of another finger of its hand is varied."""
    seed: int = 0
    """Seed of the variations."""

    def __post_init__(self) -> None:
        whole_numbers(self)
        finite(self)
        for name in ("variations", "knots"):
            within(name, getattr(self, name), 1)


class Variations:
    """Draws variations for one plan.

    Args:
        plan: which tells what finger presses which key.
        config: their distribution.
    """

    def __init__(self, plan: FingertipPlan, config: VariationConfig) -> None:
        self._plan, self._config = plan, config
        self._along = plan.fingertips[:, :, 1:, 1]
        self._spread = by_actuator(config.joint, config.wrist, config.slide)
        self._rng = np.random.default_rng(config.seed)

    def probabilities(self, frame: int, wrong: Iterable[tuple[int, int]]) -> NDArray[np.float64]:
        """(46,) probability that each actuator is varied.

        Mostly those of the fingers that miss a key or are nearest to one that is hit.

        Args:
            frame: from which on controls are varied.
            wrong: frames after it and keys that go wrong in them.
        """
        probability = np.zeros(LAYOUT.ctrl_size)
        arm = LAYOUT.arm_actuators
        for step, key in wrong:
            fingers = np.argwhere(self._plan.finger_key[frame + step] == key)
            if not len(fingers):
                away = np.abs(self._along[frame + step] - key_centres()[key, 1])
                fingers = np.argwhere(away == away.min())
            for index, finger in fingers:
                mine = probability[LAYOUT.actuators[index]]
                np.maximum(mine, self._config.others, out=mine)
                mine[arm] = np.maximum(mine[arm], self._config.arm)
                mine[LAYOUT.finger_actuators[finger]] = self._config.blamed
        return probability

    def draw(
        self, frames: int, probability: NDArray[np.float64], controls: int = 1
    ) -> NDArray[np.float64]:
        """(B, frames * controls, 46) smooth random additions to controls.

        Args:
            frames: for how many.
            probability: (46,) that each actuator is varied.
            controls: in each frame.
        """
        every = self._config.knots
        knots = np.arange(0, frames + every, every)
        size = self._config.variations, len(knots), LAYOUT.ctrl_size
        drawn = self._rng.standard_normal(size) * self._spread
        drawn *= self._rng.random((size[0], 1, size[2])) < probability
        at = np.arange(frames * controls) / controls
        low = (at // every).astype(int)
        share = ((at % every) / every)[:, None]
        smooth: NDArray[np.float64] = drawn[:, low] * (1 - share) + drawn[:, low + 1] * share
        return smooth
