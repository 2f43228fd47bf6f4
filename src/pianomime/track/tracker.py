"""What every tracker, learned or not, has to offer."""

from __future__ import annotations

from typing import Protocol

from pianomime.plan import FingertipPlan
from pianomime.track.controller import BatchController, Controller


class Tracker(Protocol):
    """Makes controllers that follow fingertip plans.

    A tracker holds settings alone. Whatever belongs to one performance is in its controller, so
    that one tracker may follow many plans at the same time.
    """

    def start(self, plan: FingertipPlan) -> Controller:
        """A controller for a plan, from the rest pose.

        Everything that can be computed before the music starts is computed here. The plan is never
        written into.

        Args:
            plan: what to follow.
        """
        ...


class BatchTracker(Tracker, Protocol):
    """A tracker whose controllers can control many worlds at once."""

    def start(self, plan: FingertipPlan) -> BatchController:
        """As `Tracker.start`."""
        ...
