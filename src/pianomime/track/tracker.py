"""What every tracker, learned or not, has to offer."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pianomime.plan import FingertipPlan
from pianomime.world import World


class Tracker(Protocol):
    """Turns a FingertipPlan and the state of the World into controls, one frame at a time."""

    def begin(self, plan: FingertipPlan) -> None:
        """Prepare for a plan: everything that can be computed before the music starts."""

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """The control (46,) for `World.step` in this frame, from the state before it.

        It depends on plan, frame and world alone: a tracker that looks ahead may ask for a frame
        more than once, on copies of the world.
        """
        ...


@runtime_checkable
class PedalTracker(Tracker, Protocol):
    """A tracker that works the sustain pedal as well; for all others the score does."""

    def pedal(self, frame: int) -> bool:
        """Whether the pedal is down in the frame whose control was asked for last."""
        ...
