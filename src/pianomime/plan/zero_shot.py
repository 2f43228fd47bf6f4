"""The zero-shot planner: fingering by beam search, then smooth hand paths; no demonstration."""

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
from pianomime.plan.strikes import strikes_of
from pianomime.world.layout import FINGER_COUNT


@dataclass(frozen=True)
class ZeroShotConfig:
    """Settings of the zero-shot planner."""

    fingering: FingeringConfig = field(default_factory=FingeringConfig)
    """Costs of the fingering search."""
    path: HandPathConfig = field(default_factory=HandPathConfig)
    """Heights and weights of the hand paths."""


class ZeroShotPlanner:
    """Plans any score; notes that ten fingers cannot reach are dropped and counted."""

    def __init__(self, config: ZeroShotConfig | None = None) -> None:
        self.config = config or ZeroShotConfig()

    def plan(self, score: Score) -> FingertipPlan:
        """Plan a score, as `Planner.plan` does."""
        fingering = find_fingering(score, self.config.fingering)
        finger_key = finger_keys(score, fingering)
        fingertips = hand_paths(finger_key, self.config.path)
        strikes = strikes_of(score, fingering)
        return FingertipPlan(fingertips, finger_key, fingering.hand, fingering.finger, strikes)


def finger_keys(score: Score, fingering: Fingering) -> NDArray[np.int8]:
    """Key that each finger presses in each frame.

    Args:
        score: the piece.
        fingering: of its notes.

    Returns:
        (T, 2, 5) int8, -1 for none, with a row for each frame of `score.roll()`.
    """
    keys = np.full((score.frames(), 2, FINGER_COUNT), NO_KEY, np.int8)
    for note in np.flatnonzero(fingering.hand >= 0):
        down = slice(fingering.start[note], fingering.stop[note])
        keys[down, fingering.hand[note], fingering.finger[note]] = score.key[note]
    return keys
