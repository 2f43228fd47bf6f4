"""Physical parameters of the world, read once from `parameters.json`.

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

from pianomime.keyboard import BLACK, FRAME_SECONDS, KEYS

PARAMETERS: dict[str, Any] = json.loads(
    resources.files("pianomime.world").joinpath("parameters.json").read_text("utf-8")
)

PHYSICS_DT: float = PARAMETERS["physics"]["timestep"]
SUBSTEPS = round(FRAME_SECONDS / PHYSICS_DT)
"""Physics steps in one control step."""


def _of_colour(parameter: str, place: int | None = None) -> np.ndarray:
    """(88, ...) A parameter of every key, stored once for black and once for white keys."""
    black, white = (
        np.asarray(PARAMETERS["keyboard"][colour][parameter]) for colour in ("black", "white")
    )
    if place is not None:
        black, white = black[place], white[place]
    return np.where(BLACK.reshape(-1, *[1] * black.ndim), black, white)


@cache
def key_centres() -> np.ndarray:
    """(88, 3) World position of the centre of each key's box at rest [m]; read-only."""
    centre = np.empty((KEYS, 3))
    centre[:, 1] = PARAMETERS["keyboard"]["key_y"]
    centre[:, 0], centre[:, 2] = _of_colour("x"), _of_colour("z")
    return _read_only(centre)


@cache
def key_half_sizes() -> np.ndarray:
    """(88, 3) Half the length (x), width (y) and height (z) of each key [m]; read-only."""
    return _read_only(_of_colour("half_size"))


@cache
def key_levers() -> np.ndarray:
    """(88,) Distance of each key's front edge from its hinge [m]; read-only."""
    return _read_only(2.0 * key_half_sizes()[:, 0])


@cache
def key_travel() -> np.ndarray:
    """(88,) Angle of each key at its stop [rad]; 0 is at rest. Read-only."""
    return _read_only(_of_colour("range", 1))


def _read_only(array: np.ndarray) -> np.ndarray:
    # All callers share one cached array.
    array.setflags(write=False)
    return array
