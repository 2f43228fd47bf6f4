"""What a controller does in the next frames, looked at in a copy of the world."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS
from pianomime.track.controller import Controller, controls_per_frame
from pianomime.track.heard import Frame, strikes_in
from pianomime.world import World


class Step(NamedTuple):
    """A frame that was looked ahead.

    Attributes:
        ctrl: (S, 46) its controls.
        frame: what was heard.
        hands: (54,) joint positions of both hands at its end [rad, m].
        state: of the world at its end, as of `World.state`.
    """

    ctrl: NDArray[np.float64]
    frame: Frame
    hands: NDArray[np.float64]
    state: NDArray[np.float64]


class LookAhead:
    """Looks ahead, and keeps what was looked at as long as it comes true.

    Attributes:
        steps: frames that were simulated so far.

    Args:
        base: the controller; it must be replayable.
    """

    def __init__(self, base: Controller) -> None:
        self._base, self._parts = base, controls_per_frame(base)
        self._known: list[Step] = []
        self._ahead: World | None = None
        self._played: NDArray[np.float64] | None = None
        self.steps = 0

    def frames(self, first: int, count: int, world: World) -> list[Step]:
        """What the controller does in some frames.

        Args:
            first: number of the first of them.
            count: how many.
            world: as it is before them.
        """
        if self._played is None or not np.array_equal(self._played, world.state()):
            self._ahead, self._known = None, []
        if self._ahead is None:
            self._ahead = world.copy(quiet=True)
        for number in range(first + len(self._known), first + count):
            self._known.append(self._step(number, self._ahead))
        return list(self._known)

    def played(self, count: int) -> None:
        """Some of the frames that were looked at are played as they are."""
        self._played = self._known[count - 1].state
        del self._known[:count]

    def forget(self) -> None:
        """Something else is played."""
        self._played = None

    def _step(self, number: int, ahead: World) -> Step:
        ctrl, strikes = [], []
        for part in range(self._parts):
            ctrl.append(self._base.control(number * self._parts + part, ahead))
            ahead.step(ctrl[-1], parts=self._parts)
            begin = (number + part / self._parts) * FRAME_SECONDS
            strikes += strikes_in(ahead.key_events, begin)
        self.steps += 1
        return Step(np.array(ctrl), Frame(strikes, ahead.pressed), ahead.qpos_hands, ahead.state())
