"""The protocol of every planner, learned or not."""

from __future__ import annotations

from typing import Protocol

from pianomime.music import Score
from pianomime.plan.fingertip_plan import FingertipPlan


class Planner(Protocol):
    """Turns a Score into a FingertipPlan. There is no base class: a method `plan` is enough."""

    def plan(self, score: Score) -> FingertipPlan:
        """Plan fingering and fingertip targets of a whole score, before the music starts.

        Args:
            score: any score. Notes that cannot be played must not raise: they are dropped, with
                -1 in `note_hand` and `note_finger`, and counted in the report.

        Returns:
            A plan with one row for each frame of `score.roll()`, and one entry of `note_hand`
            and `note_finger` for each note of the score, in its order.
        """
        ...
