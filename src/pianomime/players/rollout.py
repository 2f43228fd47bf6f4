"""The one loop in which a controller acts on a World."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.track import Controller, PedalController
from pianomime.world import World


class Step(NamedTuple):
    """A frame that was played.

    Attributes:
        frame: its number.
        ctrl: (46,) the control that was held in it, or (S, 46) those that followed one another,
            right then left [rad, m].
        pedal: whether the sustain pedal was down.
    """

    frame: int
    ctrl: NDArray[np.float64]
    pedal: bool


def rollout(controller: Controller, world: World, pedal: NDArray[np.bool_]) -> Iterator[Step]:
    """Play frame after frame, and yield each when the world is in the state after it.

    Args:
        controller: gives the controls; one that works the pedal gives that as well.
        world: where it is played, in the state before the first frame.
        pedal: (T,) bool, the pedal of the score in every frame.
    """
    pedalling = controller if isinstance(controller, PedalController) else None
    for frame in range(len(pedal)):
        ctrl = controller.control(frame, world)
        down = bool(pedal[frame]) if pedalling is None else pedalling.pedal(frame)
        world.step(ctrl, down)
        yield Step(frame, ctrl, down)
