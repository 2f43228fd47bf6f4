"""The planner that needs no demonstration: fingering by search, then smooth hand paths."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import NO_KEY
from pianomime.music import Score
from pianomime.plan.fingering import Fingering, find_fingering
from pianomime.plan.fingering_cost import FingeringConfig
from pianomime.plan.fingertip_plan import FingertipPlan
from pianomime.plan.hand_path import HandPathConfig, hand_paths


@dataclass(frozen=True)
class ZeroShotConfig:
    """The zero-shot planner."""

    fingering: FingeringConfig = field(default_factory=FingeringConfig)
    path: HandPathConfig = field(default_factory=HandPathConfig)


class ZeroShotPlanner:
    """Plans any score; what ten fingers cannot reach is left out and counted."""

    def __init__(self, config: ZeroShotConfig | None = None) -> None:
        self.config = config or ZeroShotConfig()

    def plan(self, score: Score) -> FingertipPlan:
        """One row for each frame of `score.roll()`."""
        fingering = find_fingering(score, self.config.fingering)
        finger_key = finger_keys(score, fingering)
        fingertips = hand_paths(finger_key, self.config.path)
        return FingertipPlan(fingertips, finger_key, fingering.hand, fingering.finger)


def finger_keys(score: Score, fingering: Fingering) -> NDArray[np.int8]:
    """(T, 2, 5) int8: the key each finger presses in each frame, as the score's roll has it."""
    keys = np.full((score.frames(), 2, 5), NO_KEY, np.int8)
    for note in np.flatnonzero(fingering.hand >= 0):
        down = slice(fingering.start[note], fingering.stop[note])
        keys[down, fingering.hand[note], fingering.finger[note]] = score.key[note]
    return keys
