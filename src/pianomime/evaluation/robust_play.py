"""A performance played again in a world that differs: as it is, or with feedback."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.evaluation.robust_grid import Case
from pianomime.keyboard import FRAME_SECONDS, KEYS
from pianomime.players.performance import Performance
from pianomime.players.sounding_notes import SoundingNotes
from pianomime.track.calibration import keys_aside
from pianomime.track.nominal_tracking import NominalTrackingController, Reference
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import SUBSTEPS
from pianomime.world.perturbation import PerturbedWorld, Sensors

OPEN, CLOSED = "open", "closed"
"""Loops: controls found in the nominal world are replayed; or feedback is added to them."""
LOOPS = OPEN, CLOSED

_SEED = 0
"""Of the sensors' noise, the same for all songs."""


def replayed(performance: Performance, case: Case) -> Performance:
    """What is heard where its controls are sent as they are, open loop.

    Args:
        performance: found in the nominal world.
        case: how the world differs.
    """
    world = PerturbedWorld(case.perturbation, performance.world, quiet=True)
    return _heard(performance, world, lambda frame: performance.ctrl[frame])


def tracked(performance: Performance, reference: Reference, case: Case) -> Performance:
    """What is heard where feedback keeps the hands on its motion, closed loop.

    Before it plays, it finds by touch where the keys lie, and settles.

    Args:
        performance: found in the nominal world.
        reference: what the hands did in it.
        case: how the world differs; it knows the delay, and how noisy the sensors are.

    Raises:
        InputError: the keys lie further aside than touch can tell, see `keys_aside`.
    """
    perturbation = case.perturbation
    world = PerturbedWorld(perturbation, performance.world, quiet=True)
    aside = keys_aside(world, performance.world)
    world.reset()
    controller = NominalTrackingController(
        reference,
        Sensors(perturbation, _SEED),
        delay=perturbation.delay_steps,
        aside=aside,
    )
    controller.settle(world)

    return _heard(performance, world, lambda step: controller.control(step, world), parts=SUBSTEPS)


def _heard(
    performance: Performance,
    world: PerturbedWorld,
    control: Callable[[int], NDArray[np.float64]],
    parts: int = 1,
) -> Performance:
    """What is heard in a world.

    Args:
        performance: of the same score in the nominal world.
        world: in the state before the first frame.
        control: gives what is sent, by the number of the part of a frame.
        parts: of a frame.
    """
    frames = len(performance)
    ctrl = []
    qpos = np.empty((frames, LAYOUT.qpos_size))
    key_state = np.empty((frames, KEYS))
    pressed = np.empty((frames, KEYS), bool)
    broke = np.zeros(frames, np.int64)
    notes = SoundingNotes()
    for frame in range(frames):
        for step in range(frame * parts, (frame + 1) * parts):
            ctrl.append(np.atleast_2d(control(step)))
            world.step(ctrl[-1], parts=parts)
            notes.add(world.key_events, step * FRAME_SECONDS / parts)
        qpos[frame], key_state[frame], pressed[frame] = world.qpos, world.key_state, world.pressed
        broke[frame] = world.blow_ups
    happened: dict[str, Any] = {
        "ctrl": np.concatenate(ctrl).reshape(frames, -1, LAYOUT.ctrl_size),
        "qpos": qpos,
        "key_state": key_state,
        "pressed": pressed,
        "blow_ups": np.flatnonzero(np.diff(broke, prepend=0)),
        **notes.arrays(frames * FRAME_SECONDS),
    }
    return replace(performance, **happened)
