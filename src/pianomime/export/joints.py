"""Names, units and transmissions of the joints and actuators of both hands, in the model's order.

Units are those of a position; of a velocity they are the same in a second.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.short_repr import short_repr


@dataclass(frozen=True, eq=False)
class Joints:
    """Joints and actuators of both hands, right then left.

    The last two joints of a finger, J1 and J2, have one actuator, J0, whose tendon measures the sum
    of their angles: its force is the torque of both.

    Attributes:
        names: (54) of the joints, such as `rh_FFJ3`.
        units: (54) "rad" or "m".
        actuators: (46) names of the actuators: of the joint that each moves, or `rh_FFJ0`.
        actuator_units: (46) "rad" or "m".
        mover: (54,) index of the actuator that moves each joint.
        coupled: for the index of each actuator of two joints, the indices of these.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    actuators: tuple[str, ...]
    actuator_units: tuple[str, ...]
    mover: NDArray[np.int64]
    coupled: dict[int, tuple[int, ...]]

    __repr__ = short_repr

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Joints:
        """Read them off the compiled model of a world.

        Args:
            model: of a world.
        """
        moved = [_moved(model, index) for index in range(model.nu)]
        mover = np.empty(model.njnt - KEYS, np.int64)
        for actuator, joints in enumerate(moved):
            mover[list(joints)] = actuator
        slide = model.jnt_type[KEYS:] == mujoco.mjtJoint.mjJNT_SLIDE
        units = tuple("m" if each else "rad" for each in slide)
        return cls(
            names=tuple(model.joint(KEYS + index).name for index in range(len(mover))),
            units=units,
            actuators=tuple(model.actuator(index).name for index in range(model.nu)),
            actuator_units=tuple(units[joints[0]] for joints in moved),
            mover=mover,
            coupled={index: joints for index, joints in enumerate(moved) if len(joints) > 1},
        )


def effort_unit(unit: str) -> str:
    """Unit of what moves a joint, whose position has the given one: "N m" or "N"."""
    return {"rad": "N m", "m": "N"}[unit]


def _moved(model: mujoco.MjModel, actuator: int) -> tuple[int, ...]:
    """Indices, among the hands' joints, of those that an actuator moves."""
    target = int(model.actuator_trnid[actuator, 0])
    if model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT:
        return (target - KEYS,)
    first, count = int(model.tendon_adr[target]), int(model.tendon_num[target])
    return tuple(sorted(int(joint) - KEYS for joint in model.wrap_objid[first : first + count]))
