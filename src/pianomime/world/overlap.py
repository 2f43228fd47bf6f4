"""Overlap: how deep hands are inside each other, and fingers of one hand inside each other.

In the paper's world hands pass through hands, and fingers through fingers. A model of the two
hands alone, in which these collide, measures what the world lets pass.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from pianomime.world.hand_parts import PARTS, SIDES, apart, part_of
from pianomime.world.layout import LAYOUT
from pianomime.world.model import hands_spec


class Overlap(NamedTuple):
    """Depth of the deepest overlap in each of T poses [m], 0 where there is none.

    Attributes:
        hands: (T,) of any part of one hand in any part of the other, forearms included.
        fingers: (T, 2) of any two fingers of one hand, left and right.
    """

    hands: NDArray[np.float64]
    fingers: NDArray[np.float64]


def overlap(joints: NDArray[np.floating]) -> Overlap:
    """How deep hands and fingers are inside each other.

    The depth of two convex parts is the shortest way that takes them apart. A finger begins at its
    knuckle; the metacarpal of the little finger belongs to the palm.

    Args:
        joints: (T, 54) joint positions, right hand then left hand [rad, m].

    Returns:
        The depths; NaN for a pose that is not finite.

    Raises:
        ValueError: `joints` has another shape.
    """
    if joints.ndim != 2 or joints.shape[1] != LAYOUT.hands_size:
        raise ValueError(f"joints must be (T, {LAYOUT.hands_size}), not {joints.shape}")
    model, hand_of = colliding_hands()
    data = mujoco.MjData(model)
    hands, fingers = np.zeros(len(joints)), np.zeros((len(joints), len(SIDES)))
    for row, pose in enumerate(joints):
        if not np.isfinite(pose).all():
            hands[row], fingers[row] = np.nan, np.nan
            continue
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        if not data.ncon:
            continue
        depth = -data.contact.dist
        one, other = hand_of[data.contact.geom].T
        hands[row] = depth[one != other].max(initial=0.0)
        for hand in range(len(SIDES)):
            fingers[row, hand] = depth[(one == hand) & (other == hand)].max(initial=0.0)
    return Overlap(hands, fingers)


@cache
def colliding_hands() -> tuple[mujoco.MjModel, NDArray[np.int64]]:
    """A model in which the hands, and the fingers of a hand, collide; the hand of each geom."""
    spec = hands_spec()
    # Sleeping bodies would not be looked at; the newer collider tells depths of meshes better.
    spec.option.enableflags = 0
    spec.option.disableflags = 0
    for geom in spec.geoms:
        part = part_of(geom.parent.name)
        assert part is not None
        geom.contype = 1 << PARTS.index(part)
        geom.conaffinity = sum(
            1 << index for index, other in enumerate(PARTS) if apart(part, other)
        )
    model = spec.compile()
    sides = [model.body(body).name.partition("_")[0] for body in model.geom_bodyid]
    return model, np.array([SIDES.index(side) for side in sides])
