"""What a tracker has to offer to control many worlds at once, each at its own frame of one plan."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pianomime.track.tracker import Tracker


class BatchTracker(Tracker, Protocol):
    """A tracker whose controls depend on plan, frame and positions alone."""

    def controls(
        self, frames: NDArray[np.int64], qpos: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The controls of n worlds, each bit for bit what `control` gives for it.

        Args:
            frames: (n,) of the plan.
            qpos: (n, 142) positions before them, as `World.qpos` has them [rad, m].

        Returns:
            The controls (n, 46) [rad, m], and the points of the hands (n, 2, 6, 3) [m] at these
            positions, hands (left, right), wrist and fingertips, thumb first.
        """
        ...
