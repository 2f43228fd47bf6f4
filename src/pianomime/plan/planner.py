"""What every planner, learned or not, has to offer."""

from __future__ import annotations

from typing import Protocol

from pianomime.music import Score
from pianomime.plan.fingertip_plan import FingertipPlan


class Planner(Protocol):
    """Turns a Score into a FingertipPlan with one row for each frame of `score.roll()`."""

    def plan(self, score: Score) -> FingertipPlan:
        """The targets of both hands for a whole score."""
        ...
