"""The one loop in which a controller acts on a World."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS
from pianomime.track import Controller, PedalController, controls_per_frame
from pianomime.world import World
from pianomime.world.key_sensor import NOTHING, KeyEvents


class Step(NamedTuple):
    """A frame that was played.

    Attributes:
        frame: its number.
        ctrl: (46,) the control that was held in it, or (S, 46) those that followed one another,
            right then left [rad, m].
        pedal: whether the sustain pedal was down.
        key_events: what keys did, timed from the beginning of the frame.
    """

    frame: int
    ctrl: NDArray[np.float64]
    pedal: bool
    key_events: KeyEvents


def rollout(
    controller: Controller,
    world: World,
    pedal: NDArray[np.bool_],
    watch: Callable[[], None] | None = None,
) -> Iterator[Step]:
    """Play frame after frame, and yield each when the world is in the state after it.

    Args:
        controller: gives the controls, once or several times a frame (see `FineController`); one
            that works the pedal gives that as well.
        world: where it is played, in the state before the first frame.
        pedal: (T,) bool, the pedal of the score in every frame.
        watch: called after each physics step, as of `World.step`.
    """
    pedalling = controller if isinstance(controller, PedalController) else None
    parts = controls_per_frame(controller)
    for frame in range(len(pedal)):
        sent, events = [], NOTHING
        for part in range(parts):
            sent.append(controller.control(frame * parts + part, world))
            down = bool(pedal[frame]) if pedalling is None else pedalling.pedal(frame)
            world.step(sent[-1], down, watch=watch, parts=parts)
            events = events.followed_by(world.key_events.later(part * FRAME_SECONDS / parts))
        ctrl = sent[0] if parts == 1 else np.array(sent)
        yield Step(frame, ctrl, down, events)
