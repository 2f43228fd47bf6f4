"""Playing with plans that differ in the last bits, as they do on another kind of processor.

Contacts make such differences grow until another note is missed. So what a song comes to is not one
number: tests compare with the mean and the worst of many such plays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pianomime import Performance, Score, load_player
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.plan.zero_shot import GrowingPlan
from pianomime.players import PlannedPlayer

LAST_BITS = 1e-12
"""Relative size of the disturbance; 1e-14, as plans of two processors differ, does the same."""


@dataclass(frozen=True)
class _Disturbed:
    """A planner whose plans differ in the last bits.

    Attributes:
        planner: whose plans.
        seed: of the disturbance.
    """

    planner: ZeroShotPlanner
    seed: int

    def plan(self, score: Score) -> FingertipPlan:
        """A whole plan."""
        return _moved(self.planner.plan(score), self.seed)

    def begin(self, score: Score) -> _DisturbedGrowing:
        """A plan that grows."""
        return _DisturbedGrowing(self.planner.begin(score), self.seed)


@dataclass(frozen=True)
class _DisturbedGrowing:
    """A growing plan that differs in the last bits, each frame always by the same.

    Attributes:
        growing: the plan.
        seed: of the disturbance.
    """

    growing: GrowingPlan
    seed: int

    @property
    def plan(self) -> FingertipPlan:
        """The plan so far."""
        return _moved(self.growing.plan, self.seed)

    @property
    def planned(self) -> int:
        """Number of frames whose paths are planned."""
        return self.growing.planned

    def extend(self, stop: int, ahead: int = 0) -> None:
        """Plan the paths of more frames."""
        self.growing.extend(stop, ahead)


def _moved(plan: FingertipPlan, seed: int) -> FingertipPlan:
    """The path of the joints is computed from these fingertips, and all controls from it."""
    noise = np.random.default_rng(seed).standard_normal(plan.fingertips.shape)
    return replace(plan, fingertips=plan.fingertips * (1.0 + LAST_BITS * noise))


def disturbed(name: str, effort: int, score: Score, seed: int) -> Performance:
    """What a player plays by a plan that differs in the last bits.

    Args:
        name: of a player that plans and then tracks.
        effort: of the player.
        score: what is played.
        seed: of the disturbance.
    """
    player = load_player(name, effort)
    assert isinstance(player, PlannedPlayer)
    assert isinstance(player.planner, ZeroShotPlanner)
    return replace(player, planner=_Disturbed(player.planner, seed)).play(score)
