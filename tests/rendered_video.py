"""Videos of our own world, filmed from straight above, of which everything is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import made_up_video as made_up
from pianomime.players.performance import Performance
from pianomime.video.keyboard.plane import Plane, fit_plane
from pianomime.world.hand import Hand
from pianomime.world.model import SIDES
from pianomime.world.parameters import key_centres, key_half_sizes
from pianomime.world.render import View, write_video
from pianomime.world.scene_look import key_colours

SIZE = (1280, 544)

# Of the camera "top" in `pianomime.world.scene_look`.
_ABOVE = np.array([0.10, 0.0, 2.20])
_ANGLE = np.radians(16.0)


def write(path: Path, performance: Performance, light_up: bool) -> None:
    """Film a performance, with keys that light up or only go down."""
    lit = performance.pressed if light_up else np.zeros_like(performance.pressed)
    write_video(
        path,
        performance.qpos,
        performance.pressed,
        None,
        colours=lambda frame: key_colours(lit[frame]),
        view=View(camera="top"),
    )


def camera() -> Plane:
    """The plane of the white keys' tops."""
    white = np.array([[-0.07, -0.6], [-0.07, 0.6], [0.07, -0.6], [0.07, 0.6]])
    top = key_centres()[0, 2] + key_half_sizes()[0, 2]
    return fit_plane(_pixels(np.column_stack((white, np.full(4, top)))), white)


def hands(performance: Performance) -> made_up.TrueHands:
    """Stands in for MediaPipe, which sees no hand in these: where fingertips show in the film."""
    points = np.array(
        [[hand.points(qpos[hand.joints]) for hand in map(Hand, SIDES)] for qpos in performance.qpos]
    )
    return made_up.TrueHands(camera(), SIZE, camera().to_world(_pixels(points)))


def _pixels(world: NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 2) column, row of points (..., 3) [m], as a pinhole sees them."""
    x, y, z = np.moveaxis(world - _ABOVE, -1, 0)
    focal = SIZE[1] / 2 / np.tan(_ANGLE / 2)
    return np.stack((SIZE[0] / 2 - focal * y / z, SIZE[1] / 2 - focal * x / z), axis=-1)
