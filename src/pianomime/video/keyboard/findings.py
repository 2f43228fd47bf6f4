"""What was found of a keyboard in a picture, as an object of JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pianomime.video.keyboard.geometry import BLACK_FRONT, FRONT, WHITES
from pianomime.video.keyboard.keyboard import Keyboard
from pianomime.world.parameters import key_centres


def findings(
    keyboards: Sequence[Keyboard],
    size: tuple[int, int],
    zoom: float,
    sure: bool,
    second: float | None = None,
) -> dict[str, Any]:
    """What was found, for other programs.

    Args:
        keyboards: the keyboard in each way to name its keys, the likeliest first.
        size: width and height of the picture in which it was found [pixels].
        zoom: size of the picture as it was given, divided by that.
        sure: whether there is no doubt about the names of the keys.
        second: when a film shows this picture [s]; None of a picture, or where the keyboard is in
            one place in all of the film.

    Returns:
        `found`, `sure`, `second`, `mirrored`, `lowest` and `highest` white key in the picture
        (0..87), and `keys`: for each white key in it, by its number, the pixel [u, v] in the middle
        of its front part, in the picture as it was given.
    """
    if not keyboards:
        return {
            "found": False,
            "sure": False,
            "second": None,
            "mirrored": None,
            "lowest": None,
            "highest": None,
            "keys": {},
        }
    best = keyboards[0]
    y = key_centres()[WHITES, 1]
    pixels = best.plane.to_pixels(np.stack((np.full_like(y, (BLACK_FRONT + FRONT) / 2), y), 1))
    inside = ((pixels >= 0) & (pixels <= size)).all(axis=1)
    keys = {
        str(key): [round(float(u) * zoom, 2), round(float(v) * zoom, 2)]
        for key, (u, v) in zip(WHITES[inside], pixels[inside], strict=True)
    }
    return {
        "found": True,
        "sure": sure,
        "second": second,
        "mirrored": best.mirrored,
        "lowest": int(WHITES[inside][0]) if keys else None,
        "highest": int(WHITES[inside][-1]) if keys else None,
        "keys": keys,
    }
