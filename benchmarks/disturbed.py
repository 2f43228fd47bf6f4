"""Playing with plans that differ in the last bits, as they do on another kind of processor.

Contacts make such differences grow until another note is missed. So what a song comes to is not one
number: tests compare with the mean and the worst of many such plays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pianomime import Performance, Score, load_player
from pianomime.plan import FingertipPlan, Planner
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

    planner: Planner
    seed: int

    def plan(self, score: Score) -> FingertipPlan:
        """The path of the joints is computed from these fingertips, and all controls from it."""
        plan = self.planner.plan(score)
        noise = np.random.default_rng(self.seed).standard_normal(plan.fingertips.shape)
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
    return replace(player, planner=_Disturbed(player.planner, seed)).play(score)
