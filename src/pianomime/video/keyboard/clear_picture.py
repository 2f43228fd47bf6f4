"""A picture of a film on which a person can mark the keyboard."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE
from pianomime.video.film.background import median_of, sampled
from pianomime.video.film.film import Film
from pianomime.video.keyboard.following import stands_still
from pianomime.video.keyboard.keyboard import find_keyboards

_TRIED = 6
"""Single pictures, spread over the film, in which a keyboard is looked for."""


def clear_picture(film: Film) -> tuple[NDArray[np.uint8], float | None]:
    """What most of a film shows, without hands; one picture of it if the keyboard moves in it.

    Args:
        film: the film.

    Returns:
        Picture (height, width, 3) uint8, at the working size, and when it is shown [s]: None if it
        is no single one.

    Raises:
        InputError: no picture in it can be read.
    """
    pictures = sampled(film)
    brightness = median_of(pictures)
    keyboards = find_keyboards(brightness)
    if not (keyboards and stands_still(pictures, brightness, keyboards[0].plane)):
        for part in range(_TRIED):
            number = int((part + 0.5) / _TRIED * film.seconds * FRAME_RATE)
            frame = next(film.frames(FRAME_RATE, number), None)
            if frame is not None and find_keyboards(median_of([frame.picture])):
                return frame.picture, number / FRAME_RATE
    # Row by row, to save memory.
    rows = [
        np.median([picture[row] for picture in pictures], axis=0) for row in range(len(pictures[0]))
    ]
    return np.stack(rows).astype(np.uint8), None
