"""Limits of joints and actuators, and what of a performance breaks them, at every physics step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from pianomime.export.joints import Joints, effort_unit
from pianomime.export.samples import PHYSICS_RATE
from pianomime.keyboard import KEYS
from pianomime.players.motion import FrameMotion
from pianomime.short_repr import short_repr
from pianomime.world.parameters import SUBSTEPS

_HAND_SPEED = 2.0
"""[rad/s] Limit of wrists and fingers in Shadow Robot's own description of the hand (the URDF of
its package `sr_description`, attribute `velocity`), but for those of `_FASTER`. The model of the
world has no such limit."""
_FASTER = {"THJ5": 4.0, "THJ4": 4.0}
"""[rad/s] That of the joints at the thumb's base, by their names without the side."""
_SLACK = 1e-3
"""[rad, m] A position beyond its limit by no more is at it: limits in the simulation are soft."""
_ROUNDING = 1e-9
"""Share of a limit by which a force or a speed may be over it."""


class Breach(NamedTuple):
    """How one limit of one joint or actuator was broken.

    Attributes:
        name: of the joint, or of the actuator for commands and efforts.
        kind: "position", "velocity", "effort" or "command".
        unit: of the limit and the worst value.
        limit: the one that was broken; if both were, that of the worst value.
        worst: the value that was furthest beyond it.
        at: when [s].
        steps: number of physics steps in which it was broken.
        share: of all physics steps.
    """

    name: str
    kind: str
    unit: str
    limit: float
    worst: float
    at: float
    steps: int
    share: float


@dataclass(frozen=True, eq=False)
class Limits:
    """What joints and actuators of both hands may do; infinite where there is no limit.

    Attributes:
        joints: their names and units.
        lower, upper: (54,) of the joints' positions [rad, m].
        velocity: (54,) greatest speed of each joint [rad/s, m/s]: of the hand's `hand_speeds`; of
            the forearms' slides the speed at which the model's motor has no force left.
        effort: (46,) greatest torque or force of each actuator [N m, N].
        low, high: (46,) of the actuators' targets [rad, m].
    """

    joints: Joints
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    __repr__ = short_repr

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Limits:
        """The limits of the hands in a world.

        Args:
            model: of the world.
        """
        joints = Joints.of(model)
        limited = model.actuator_forcelimited.astype(bool)
        effort = np.where(limited, np.abs(model.actuator_forcerange).max(axis=1), np.inf)
        lower, upper = model.jnt_range[KEYS:].T
        low, high = model.actuator_ctrlrange.T
        slide = np.array(joints.units) == "m"
        # Damping takes of a slide's force what its motor loses with speed.
        no_load = effort[joints.mover] / model.dof_damping[KEYS:]
        return cls(
            joints=joints,
            lower=lower.copy(),
            upper=upper.copy(),
            velocity=np.where(slide, no_load, hand_speeds(joints)),
            effort=effort,
            low=low.copy(),
            high=high.copy(),
        )


def hand_speeds(joints: Joints) -> NDArray[np.float64]:
    """(54,) Speeds that Shadow Robot allows each joint of its hand [rad/s]; inf for slides.

    Args:
        joints: their names and units.
    """
    speeds = [_FASTER.get(name.partition("_")[2], _HAND_SPEED) for name in joints.names]
    return np.where(np.array(joints.units) == "m", np.inf, speeds)


class LimitCheck:
    """Looks at a performance frame by frame, and keeps what broke a limit.

    Args:
        limits: to be kept.
    """

    def __init__(self, limits: Limits) -> None:
        self._frames = 0
        joints = limits.joints
        speeds = [f"{unit}/s" for unit in joints.units]
        efforts = [effort_unit(unit) for unit in joints.actuator_units]
        self._worst: dict[str, _Worst] = {
            "position": _Worst(joints.names, joints.units, limits.lower, limits.upper, _SLACK),
            "velocity": _Worst.even(joints.names, speeds, limits.velocity),
            "effort": _Worst.even(joints.actuators, efforts, limits.effort),
            "command": _Worst(
                joints.actuators, joints.actuator_units, limits.low, limits.high, _SLACK
            ),
        }

    def see(self, moved: FrameMotion, command: NDArray[np.float64]) -> None:
        """Look at the next frame.

        Args:
            moved: how the hands moved in it.
            command: (S, 46) targets of the actuators in it [rad, m].
        """
        began = self._frames * SUBSTEPS + np.arange(SUBSTEPS)
        begin, end = began / PHYSICS_RATE, (began + 1) / PHYSICS_RATE
        self._worst["position"].see(moved.position[1:], end)
        self._worst["velocity"].see(moved.velocity[1:], end)
        self._worst["effort"].see(moved.force, begin)
        held = np.repeat(command, SUBSTEPS // len(command), axis=0)
        self._worst["command"].see(held, begin)
        self._frames += 1

    def breaches(self) -> list[Breach]:
        """What was broken so far, by kind and in the order of the model."""
        steps = self._frames * SUBSTEPS
        return [each for kind, worst in self._worst.items() for each in worst.breaches(kind, steps)]


class _Worst:
    """Of each of some values: how often it was beyond its limits, and the furthest."""

    def __init__(
        self,
        names: tuple[str, ...],
        units: tuple[str, ...],
        lower: NDArray[np.float64],
        upper: NDArray[np.float64],
        slack: float | NDArray[np.float64],
    ) -> None:
        self._names, self._units = names, units
        self._lower, self._upper, self._slack = lower, upper, slack
        self._beyond, self._at = np.zeros(len(names)), np.zeros(len(names))
        self._value, self._count = np.zeros(len(names)), np.zeros(len(names), np.int64)

    @classmethod
    def even(
        cls, names: tuple[str, ...], units: list[str], greatest: NDArray[np.float64]
    ) -> _Worst:
        """Of values whose size alone is limited."""
        slack = np.where(np.isinf(greatest), 0.0, greatest * _ROUNDING)
        return cls(names, tuple(units), -greatest, greatest, slack)

    def see(self, values: NDArray[np.float64], times: NDArray[np.floating]) -> None:
        beyond = np.maximum(values - self._upper, self._lower - values) - self._slack
        self._count += (beyond > 0).sum(axis=0)
        rows, columns = beyond.argmax(axis=0), np.arange(len(self._names))
        worse = beyond[rows, columns] > self._beyond
        rows, columns = rows[worse], columns[worse]
        self._beyond[worse] = beyond[rows, columns]
        self._value[worse] = values[rows, columns]
        self._at[worse] = times[rows]

    def breaches(self, kind: str, steps: int) -> list[Breach]:
        return [
            Breach(
                name=self._names[index],
                kind=kind,
                unit=self._units[index],
                limit=float(
                    (self._upper if self._value[index] > self._upper[index] else self._lower)[index]
                ),
                worst=float(self._value[index]),
                at=float(self._at[index]),
                steps=int(self._count[index]),
                share=float(self._count[index] / steps),
            )
            for index in np.flatnonzero(self._count)
        ]
