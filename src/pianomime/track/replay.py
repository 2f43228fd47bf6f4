"""The tracker that plays what was found before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.plan import FingertipPlan
from pianomime.world import World


@dataclass(frozen=True, eq=False)
class ReplayTracker:
    """Plays controls of one song, whatever happens.

    Attributes:
        ctrl: (T, 46) right then left [rad, m].
    """

    ctrl: NDArray[np.float64]

    def begin(self, plan: FingertipPlan) -> None:
        """Check that the plan is as long as the controls.

        Raises:
            ValueError: it is not.
        """
        if len(plan) != len(self.ctrl):
            raise ValueError(f"{len(self.ctrl)} controls for a plan of {len(plan)} frames")

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) the control of a frame."""
        row: NDArray[np.float64] = self.ctrl[frame]
        return row
