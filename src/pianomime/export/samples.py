"""Samples: how the hands moved and what moved them, at any rate."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.export.joints import Joints
from pianomime.keyboard import FRAME_RATE
from pianomime.players.motion import FrameMotion, motion
from pianomime.players.performance import Performance
from pianomime.short_repr import count
from pianomime.world.model import world_model
from pianomime.world.parameters import PHYSICS_DT, SUBSTEPS

_FRAME_RATE = round(FRAME_RATE)
PHYSICS_RATE = SUBSTEPS * _FRAME_RATE
"""Physics steps in a second of music."""
MAX_RATE = 1000
"""[Hz] Five samples in a physics step; what is between two steps is interpolated, not simulated."""


class Samples(NamedTuple):
    """n samples of both hands, right then left; joints and actuators are those of `Joints`.

    At the times of physics steps they are the states of the simulation. Between two of these,
    positions are the cubic polynomial of both steps' positions and velocities, and velocities its
    derivative; keys turn evenly. Targets and efforts change with the steps.

    Attributes:
        time: (n,) from the first frame [s].
        position: (n, 54) of the joints [rad, m].
        velocity: (n, 54) likewise [rad/s, m/s].
        effort: (n, 54) of the actuators on each joint, in the physics step that begins then, or is
            going on [N m, N].
        command: (n, 46) targets that the actuators have from then on, within their ranges [rad, m].
        keys: (n, 88) angle of each key [rad].
    """

    time: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]
    command: NDArray[np.float64]
    keys: NDArray[np.float64]


def commands(performance: Performance) -> NDArray[np.float64]:
    """(T, S, 46) The targets that the actuators had: controls, cut to their ranges by the World.

    Args:
        performance: of whose controls.
    """
    low, high = world_model(performance.world).actuator_ctrlrange.T
    cut: NDArray[np.float64] = np.clip(performance.ctrl, low, high)
    return cut


def played_again(performance: Performance) -> Iterator[FrameMotion]:
    """The motion of one frame after the other, if it is one that hands could follow.

    Args:
        performance: which is played again from the rest pose.

    Yields:
        As `players.motion` does.

    Raises:
        InputError: a control is not finite, the physics broke while it was played, or here the
            controls lead elsewhere.
    """
    if not np.isfinite(performance.ctrl).all():
        raise InputError("a control of this performance is not a finite number")
    if len(performance.blow_ups):
        first = performance.blow_ups.min() / FRAME_RATE
        raise InputError(
            f"the physics broke in {count(len(performance.blow_ups), 'frame')}, first at "
            f"{first:.2f} s: "
            "there hands were put back, which is no motion"
        )
    for frame, moved in enumerate(motion(performance)):
        if not moved.same:
            raise InputError(
                f"its controls lead elsewhere from {frame / FRAME_RATE:.2f} s on: it was played on "
                "another machine, or with other versions; play it again here"
            )
        yield moved


def samples(performance: Performance, rate: int) -> Iterator[Samples]:
    """The samples of one frame after the other: of its beginning, but of its end only in the last.

    Args:
        performance: which is played again for it.
        rate: samples in a second, 1 to 1000.

    Yields:
        Of each frame as many as there are, which may be none.

    Raises:
        InputError: there is no such rate, or the performance cannot be played again.
    """
    sampler = Sampler(performance, rate)
    for frame, moved in enumerate(played_again(performance)):
        yield sampler.of(frame, moved)


class Sampler:
    """Takes the samples of frames.

    Args:
        performance: that the frames are of.
        rate: samples in a second, 1 to 1000.

    Raises:
        InputError: there is no such rate.
    """

    def __init__(self, performance: Performance, rate: int) -> None:
        if not 1 <= rate <= MAX_RATE:
            raise InputError(f"rate must be 1 to {MAX_RATE} Hz, not {rate}")
        self._command, self._rate = commands(performance), rate
        self._mover = Joints.of(world_model(performance.world)).mover

    def of(self, frame: int, moved: FrameMotion) -> Samples:
        """The samples of a frame.

        Args:
            frame: its number.
            moved: its motion.
        """
        # In whole numbers: a sample is at a physics step, or it is not.
        first, end = (-(-number * self._rate // _FRAME_RATE) for number in (frame, frame + 1))
        last = frame + 1 == len(self._command)
        if last and (frame + 1) * self._rate % _FRAME_RATE == 0:
            end += 1
        number = np.arange(first, end)
        step, part = np.divmod(number * PHYSICS_RATE - frame * SUBSTEPS * self._rate, self._rate)
        share = part / self._rate
        position, velocity = _between(moved, step, share)
        going_on = np.minimum(step, SUBSTEPS - 1)
        held = going_on * self._command.shape[1] // SUBSTEPS
        return Samples(
            time=number / self._rate,
            position=position,
            velocity=velocity,
            effort=moved.force[going_on][:, self._mover],
            command=self._command[frame, held],
            keys=_evenly(moved.keys, step, share),
        )


def _between(
    moved: FrameMotion, step: NDArray[np.int64], share: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n, 54) Positions and velocities of the hands at shares (0 to 1) of physics steps."""
    after = np.minimum(step + 1, SUBSTEPS)
    start, rise = moved.position[step], moved.position[after] - moved.position[step]
    slope, slope_after = moved.velocity[step] * PHYSICS_DT, moved.velocity[after] * PHYSICS_DT
    # Hermite's cubic, written so that it is the state of the simulation where the share is 0.
    square, cube = 3 * rise - 2 * slope - slope_after, slope + slope_after - 2 * rise
    share = share[:, None]
    position = start + share * (slope + share * (square + share * cube))
    turned = moved.velocity[step] + share * (2 * square + 3 * share * cube) / PHYSICS_DT
    return position, turned


def _evenly(
    values: NDArray[np.float64], step: NDArray[np.int64], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, ...) Values at shares of physics steps, between which they change evenly."""
    after = np.minimum(step + 1, SUBSTEPS)
    between: NDArray[np.float64] = values[step] + share[:, None] * (values[after] - values[step])
    return between
