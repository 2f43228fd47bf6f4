"""The solid world: what differs from the paper's. Hands collide, and what moves them has limits.

`docs/concepts/the-world.md` says what is modelled, what is not, and where the numbers are from.
"""

from __future__ import annotations

import mujoco

from pianomime.world.hand_parts import PALM, PARTS, Part, apart, part_of
from pianomime.world.parameters import PARAMETERS

RAIL_SPEED = 1.9
"""[m/s] No-load speed of the motors of the forearms' rails. With what collisions and the reactions
of fingers add, rails stay below 2 m/s."""
RAIL_FORCE = 150.0
"""[N] Most that a rail's motor pushes with."""
JOINT_SPEED = 15.0
"""[rad/s] No-load speed of the motors of wrists and fingers. A third of the force is left at 10
rad/s, with which a finger of 0.1 m moves a key at 1 m/s: forte (see `pianomime.world.touch`)."""
MARGIN = 0.001
"""[m] Distance between parts of hands at which they begin to push each other away. A finger of
0.2 m/s moves so far in a physics step, and would be as deep in another one before it is noticed."""

_TOUCHES_KEYS = 1
"""Bit of what collides with keys and with the piano's body."""
_ENDS = ("middle", "distal")
"""Links of a finger that collide with their own palm; the others are its neighbours."""
_INVISIBLE = 3
"""MuJoCo's viewers show no geoms of this group unless they are asked to."""


def collide(spec: mujoco.MjSpec) -> None:
    """Let hands, forearms, fingers and the piano's body collide.

    What collides with keys stays as it is in the paper's world. Beside each geom of a hand there is
    another of the same shape that collides with hands alone, and a little earlier. Links of one
    finger do not collide with each other: the limits of its joints keep them apart.

    Args:
        spec: of piano and both hands in the paper's world; changed in place.
    """
    for geom in list(spec.geoms):
        part = part_of(geom.parent.name)
        if part is None:
            geom.conaffinity = _TOUCHES_KEYS
            continue
        others = [other for other in PARTS if apart(part, other)]
        if part.finger != PALM and geom.parent.name.endswith(_ENDS):
            others.append(Part(part.side, PALM))
        geom.parent.add_geom(
            type=geom.type,
            meshname=geom.meshname,
            size=geom.size,
            pos=geom.pos,
            quat=geom.quat,
            contype=_bit(part),
            conaffinity=sum(map(_bit, others)),
            margin=MARGIN / 2,  # MuJoCo adds those of two geoms.
            group=_INVISIBLE,
            **{name: getattr(geom, name) for name in PARAMETERS["hand"]["contact"]},
        )


def limit(spec: mujoco.MjSpec) -> None:
    """Give every motor of the hands a stall force that fits its no-load speed.

    A motor that pushes with F against a damper of b moves no faster than F / b: the force that is
    left at speed v is F - b v, the straight line by which a motor's force falls with its speed. The
    paper's dampers stay, so the motion between the limits is that of the paper's world.

    Args:
        spec: of one hand or both in the paper's world; changed in place.
    """
    joints = {joint.name: joint for joint in spec.joints}
    for actuator in spec.actuators:
        joint = joints.get(actuator.target)
        if joint is None:  # A tendon, which couples two joints with one damping.
            tendon = next(one for one in spec.tendons if one.name == actuator.target)
            joint = joints[tendon.path[0].target.name]
        rail = joint.type == mujoco.mjtJoint.mjJNT_SLIDE
        speed, most = (RAIL_SPEED, RAIL_FORCE) if rail else (JOINT_SPEED, actuator.forcerange[1])
        force = min(most, speed * joint.damping[0])
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        actuator.forcerange = (-force, force)


def _bit(part: Part) -> int:
    """Bit of what collides with a part."""
    return _TOUCHES_KEYS << 1 + PARTS.index(part)
