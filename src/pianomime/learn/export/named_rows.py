"""Named rows: the numbers of an episode as other libraries train on them, with names and units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.export.joints import Joints
from pianomime.keyboard import KEYS, key_name
from pianomime.plan.fingertip_plan import POINTS
from pianomime.policies.horizon import CHUNK
from pianomime.world.model import world_model

COLUMNS_READ = ("joints", "velocities", "keys", "goal", "fingertips", "action")
"""The columns of an episode that `rows` needs."""
GOAL_FRAMES = CHUNK
"""Frames of goals and of fingertips in a row, the present one first: as many as low-level policies
of the paper see."""
_HANDS = ("left", "right")
"""Hands in the order of the column `fingertips`."""


def names(world: str) -> dict[str, tuple[str, ...]]:
    """The name of each number of a row, with its unit, in the order of the flattened arrays.

    Args:
        world: name of the world that the episodes were played in.

    Returns:
        Of each array that `rows` gives, names that no other number has.
    """
    joints = Joints.of(world_model(world))
    of_joints = list(zip(joints.names, joints.units, strict=True))
    keys = [key_name(key) for key in range(KEYS)]
    return {
        "joints": tuple(f"{name} [{unit}]" for name, unit in of_joints),
        "velocities": tuple(f"{name} [{unit}/s]" for name, unit in of_joints),
        "keys": tuple(f"key {key} down [0..1]" for key in keys),
        "goals": tuple(
            f"key {key} wanted, frame +{ahead} [0 or 1]"
            for ahead in range(GOAL_FRAMES)
            for key in keys
        ),
        "fingertips": tuple(
            f"{hand} {point} {axis}, frame +{ahead} [m]"
            for ahead in range(GOAL_FRAMES)
            for hand in _HANDS
            for point in POINTS
            for axis in "xyz"
        ),
        "action": tuple(
            f"{name} target [{unit}]"
            for name, unit in zip(joints.actuators, joints.actuator_units, strict=True)
        ),
    }


def rows(columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[np.float32]]:
    """The rows of an episode.

    After the last frame no key is wanted, and the fingertips stay where they are.

    Args:
        columns: at least `COLUMNS_READ`, of T frames.

    Returns:
        For each frame, before its action: `joints` (T, 54), `velocities` (T, 54), `keys` (T, 88),
        `goals` (T, GOAL_FRAMES, 88) and `fingertips` (T, GOAL_FRAMES, 2, 6, 3) of the plan; and the
        `action` (T, 46).
    """
    frames = len(columns["action"])
    ahead = np.arange(frames)[:, None] + np.arange(GOAL_FRAMES)
    there = np.minimum(ahead, frames - 1)
    made = {
        "joints": columns["joints"],
        "velocities": columns["velocities"],
        "keys": columns["keys"],
        "goals": columns["goal"][there] & (ahead < frames)[..., None],
        "fingertips": columns["fingertips"][there],
        "action": columns["action"],
    }
    return {name: np.asarray(array, np.float32) for name, array in made.items()}
