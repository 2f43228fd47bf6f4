"""Motion: how the hands of a performance moved between its frames, found by playing it again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.players.performance import Performance
from pianomime.world import World
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import SUBSTEPS

_SAME = 1e-3
"""[m, rad] Positions nearer than this at the end of every frame are the same motion. On one machine
they are the same bit for bit; another may round in another way."""


class FrameMotion(NamedTuple):
    """Keys and hands in one frame; of the hands right 27 joints, then left 27.

    Attributes:
        keys: (11, 88) angle of each key at the beginning, and after each physics step [rad].
        position: (11, 54) of the hands' joints likewise [rad, m].
        velocity: (11, 54) of the hands' joints likewise [rad/s, m/s].
        force: (10, 46) of the actuators in each physics step, right 23 then left 23 [N m, N].
        same: whether it led to the positions that the performance has kept.
    """

    keys: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    force: NDArray[np.float64]
    same: bool


def motion(performance: Performance) -> Iterator[FrameMotion]:
    """Play the controls of a performance again, from the rest pose, and watch every physics step.

    Args:
        performance: with any number of controls a frame.

    Yields:
        The motion of one frame after the other.

    Raises:
        ValueError: a control is not finite.
    """
    position = np.empty((SUBSTEPS + 1, LAYOUT.qpos_size))
    velocity = np.empty((SUBSTEPS + 1, LAYOUT.hands_size))
    force = np.empty((SUBSTEPS, LAYOUT.ctrl_size))
    world, steps = World(performance.world, quiet=True), 0

    def watch() -> None:
        nonlocal steps
        step = steps % SUBSTEPS
        position[step + 1] = world.data.qpos
        velocity[step + 1], force[step] = world.data.qvel[KEYS:], world.data.actuator_force
        steps += 1

    for ctrl, kept in zip(performance.ctrl, performance.qpos, strict=True):
        position[0], velocity[0] = world.data.qpos, world.data.qvel[KEYS:]
        world.step(ctrl, watch=watch)
        apart = np.abs(world.qpos_hands - kept[KEYS:]).max()
        keys, hands = np.split(position, [KEYS], axis=1)
        yield FrameMotion(
            keys.copy(), hands.copy(), velocity.copy(), force.copy(), bool(apart <= _SAME)
        )
