"""Replay: controls of one song that were found before, whatever happens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pianomime.plan import FingertipPlan
from pianomime.short_repr import short_repr
from pianomime.world import World


@dataclass(frozen=True, eq=False)
class ReplayController:
    """Plays stored controls, open loop.

    Attributes:
        plan: what they were found for.
        ctrl: (T, 46) right then left [rad, m].
    """

    plan: FingertipPlan
    ctrl: NDArray[np.float64]
    replayable: ClassVar[bool] = True

    __repr__ = short_repr

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) the stored control of a frame."""
        row: NDArray[np.float64] = self.ctrl[frame]
        return row


@dataclass(frozen=True, eq=False)
class ReplayTracker:
    """Plays stored controls of one song.

    Attributes:
        ctrl: (T, 46) right then left [rad, m].
    """

    ctrl: NDArray[np.float64]

    __repr__ = short_repr

    def start(self, plan: FingertipPlan) -> ReplayController:
        """A controller that plays them.

        Raises:
            ValueError: the plan is not as long as the controls.
        """
        if len(plan) != len(self.ctrl):
            raise ValueError(f"{len(self.ctrl)} controls for a plan of {len(plan)} frames")
        return ReplayController(plan, self.ctrl)
