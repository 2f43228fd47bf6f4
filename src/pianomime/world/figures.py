"""The figures of the physical world, read once from `figures.json`.

Hand: MuJoCo Menagerie's Shadow Hand (Apache-2.0) on RoboPianist's sliding forearms, with the
changes of the PianoMime paper (a third, vertical slide; stiffer forearm actuators). The file
holds the right hand; the left one is its mirror image.
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

FIGURES: dict[str, Any] = json.loads(
    resources.files("pianomime.world").joinpath("figures.json").read_text("utf-8")
)

PHYSICS_DT: float = FIGURES["physics"]["timestep"]
CONTROL_DT: float = FIGURES["physics"]["control_timestep"]
SUBSTEPS = round(CONTROL_DT / PHYSICS_DT)

KEYS = 88
HAND_JOINTS = 27
HAND_ACTUATORS = 23
RIGHT_JOINTS = slice(KEYS, KEYS + HAND_JOINTS)
LEFT_JOINTS = slice(KEYS + HAND_JOINTS, KEYS + 2 * HAND_JOINTS)
FINGER_PREFIXES = ("th", "ff", "mf", "rf", "lf")
FINGER_JOINTS = (slice(22, 27), slice(5, 9), slice(9, 13), slice(13, 17), slice(17, 22))
"""Joints of each finger among those of its hand, thumb first."""
FINGER_ACTUATORS = (slice(2, 7), slice(7, 10), slice(10, 13), slice(13, 16), slice(16, 20))
"""Its actuators among those of its hand."""

BLACK = np.array([(key + 9) % 12 in (1, 3, 6, 8, 10) for key in range(KEYS)])
"""(88,) bool: the black keys; key 0 is A0."""


def _colour(name: str, figure: str) -> Any:
    return FIGURES["keyboard"][name][figure]


@cache
def key_centres() -> np.ndarray:
    """(88, 3) [m] world position of the middle of each key's box, at rest; read-only."""
    centre = np.empty((KEYS, 3))
    centre[:, 1] = FIGURES["keyboard"]["key_y"]
    for column, figure in ((0, "x"), (2, "z")):
        centre[:, column] = np.where(BLACK, _colour("black", figure), _colour("white", figure))
    return _read_only(centre)


@cache
def key_half_sizes() -> np.ndarray:
    """(88, 3) [m] half the length (x), width (y) and height (z) of each key; read-only."""
    black, white = _colour("black", "half_size"), _colour("white", "half_size")
    return _read_only(np.where(BLACK[:, None], black, white))


@cache
def key_travel() -> np.ndarray:
    """(88,) [rad] angle of each key at its stop; 0 is at rest. Read-only."""
    return _read_only(np.where(BLACK, _colour("black", "range")[1], _colour("white", "range")[1]))


def _read_only(figures: np.ndarray) -> np.ndarray:
    # One array serves all callers.
    figures.setflags(write=False)
    return figures
