"""The loop in which a controller acts on a World, and that in which many act side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_SECONDS
from pianomime.track import Controller, PedalController, controls_per_frame
from pianomime.world import World
from pianomime.world.batch_base import OneOfBatch, WorldBatchBase
from pianomime.world.key_sensor import NOTHING, KeyEvents
from pianomime.world.layout import LAYOUT


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


def rollout_together(
    controllers: Sequence[Controller],
    worlds: WorldBatchBase,
    pedals: Sequence[NDArray[np.bool_]],
) -> Iterator[dict[int, Step | InputError]]:
    """Play side by side, each controller in a world of its own.

    Args:
        controllers: give one control a frame, do not work the pedal, and read of their world what a
            `WorldState` has.
        worlds: as many, in the state before the first frame.
        pedals: of each (T,) bool, the pedal of its score in every frame.

    Yields:
        After each frame what was done in it, for those that are not at the end of their song by
        their indices; an error, the last of its index, for one whose controller could not go on.
    """
    views = [OneOfBatch(worlds, index) for index in range(len(worlds))]
    playing = {index: len(pedal) for index, pedal in enumerate(pedals)}
    # All step, also those that have ended: on a GPU to step some takes longer than to step all.
    ctrl = np.zeros((len(worlds), LAYOUT.ctrl_size))
    down = np.zeros(len(worlds), bool)
    for frame in range(max(playing.values())):
        steps: dict[int, Step | InputError] = {}
        for index in [index for index, frames in playing.items() if frame < frames]:
            try:
                # A view is no World, but has all that these controllers read.
                ctrl[index] = controllers[index].control(frame, cast(World, views[index]))
            except InputError as error:
                steps[index] = error
                del playing[index]
            down[index] = pedals[index][frame]
        worlds.step(ctrl, down)
        for index, frames in playing.items():
            if frame < frames:
                events = views[index].key_events
                steps[index] = Step(frame, ctrl[index].copy(), bool(down[index]), events)
        yield steps
