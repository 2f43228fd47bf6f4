"""Motion: how the hands of a performance moved between its frames, found by playing it again."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True, eq=False)
class Motion:
    """The hands after each of N physics steps, right 27 then left 27 joints.

    Attributes:
        frame: (N,) frame of each step.
        velocity: (N, 54) of the joints [rad/s, m/s].
        force: (N, 46) of the actuators, right 23 then left 23 [N m, N].
        same: whether it led through the positions that the performance has kept.
    """

    frame: NDArray[np.int64]
    velocity: NDArray[np.float64]
    force: NDArray[np.float64]
    same: bool


def motion(performance: Performance) -> Motion:
    """Play the controls of a performance again, from the rest pose, and watch every physics step.

    Args:
        performance: with any number of controls a frame.
    """
    frames = len(performance)
    velocity = np.empty((frames * SUBSTEPS, LAYOUT.hands_size))
    force = np.empty((frames * SUBSTEPS, LAYOUT.ctrl_size))
    apart = np.zeros(frames)
    world = World(quiet=True)
    rows = iter(range(len(velocity)))

    def watch() -> None:
        row = next(rows)
        velocity[row] = world.data.qvel[KEYS:]
        force[row] = world.data.actuator_force

    for frame, ctrl in enumerate(performance.ctrl):
        # MuJoCo would not take controls that are not finite; the motion ends before them.
        if not np.isfinite(ctrl).all():
            apart[frame:] = np.nan
            velocity[frame * SUBSTEPS :] = force[frame * SUBSTEPS :] = np.nan
            break
        world.step(ctrl, watch=watch)
        apart[frame] = np.abs(world.qpos_hands - performance.qpos[frame, KEYS:]).max()
    # Not `apart > _SAME`: what is not finite is not the same.
    same = bool((apart <= _SAME).all())
    return Motion(np.repeat(np.arange(frames), SUBSTEPS), velocity, force, same)
