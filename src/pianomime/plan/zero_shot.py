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
from pianomime.plan.hand_path import HandPathConfig, HandPaths
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
        growing = self.begin(score)
        growing.extend(score.frames())
        return growing.plan

    def begin(self, score: Score) -> GrowingPlan:
        """A plan whose fingering is known, and nothing of its paths yet."""
        return GrowingPlan(score, self.config)


class GrowingPlan:
    """A plan whose fingering is known, and whose paths are planned from the first frame on.

    Args:
        score: what is planned.
        config: settings of the planner.
    """

    def __init__(self, score: Score, config: ZeroShotConfig) -> None:
        self._fingering = find_fingering(score, config.fingering)
        self._finger_key = finger_keys(score, self._fingering)
        self._strikes = strikes_of(score, self._fingering)
        self._paths = HandPaths(self._finger_key, config.path)

    @property
    def plan(self) -> FingertipPlan:
        """The plan so far; what `HandPaths` has of it is written into."""
        return FingertipPlan(
            self._paths.fingertips,
            self._finger_key,
            self._fingering.hand,
            self._fingering.finger,
            self._strikes,
            self._paths.joints,
        )

    @property
    def planned(self) -> int:
        """Number of frames whose paths are planned."""
        return self._paths.planned

    def extend(self, stop: int, ahead: int = 0) -> None:
        """Plan the paths of more frames, as `HandPaths.extend` does."""
        self._paths.extend(stop, ahead)


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
