"""The paper's cost: keys that are wrong at the ends of frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pianomime.track.heard import Frame, Strike


class KeyCost:
    """Each key that is wrong at the end of a frame costs 1.

    Args:
        goal: (T, 88) bool, the keys that should be down at the end of each frame.
    """

    short = 0.1

    def __init__(self, goal: NDArray[np.bool_]) -> None:
        self._goal = goal

    def heard(self, strikes: Sequence[Strike]) -> None:
        """Nothing: keys do not count for what they did before."""

    def of(
        self, first: int, frames: Sequence[Frame], count: int
    ) -> tuple[float, list[tuple[int, int]]]:
        """As of `Cost.of`: the number of wrong keys, and these."""
        wrong = [
            (step, int(key))
            for step, frame in enumerate(frames[:count])
            for key in np.flatnonzero(frame.pressed != self._goal[first + step])
        ]
        return float(len(wrong)), wrong

    def tally(self, first: int) -> KeyTally:
        """As of `Cost.tally`."""
        return KeyTally(self._goal[first:])


class KeyTally:
    """Wrong keys of some frames, as they are heard.

    Attributes:
        least: number of them so far.

    Args:
        goal: (T, 88) bool, the keys that should be down at the end of each frame.
    """

    def __init__(self, goal: NDArray[np.bool_]) -> None:
        self._goal, self._frames = goal, 0
        self.least = 0.0

    def add(self, frame: Frame) -> None:
        """What is pressed at the end of the next frame."""
        self.least += float(np.count_nonzero(frame.pressed != self._goal[self._frames]))
        self._frames += 1

    def total(self) -> float:
        """The number of them."""
        return self.least
