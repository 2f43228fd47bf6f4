"""The background of a film: what it shows most of the time, without hands and lights."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.video.film.film import Film

_FRAMES = 25


def background(film: Film) -> NDArray[np.float32]:
    """Median of some grey pictures of a film.

    Args:
        film: the film, of a camera that does not move.

    Returns:
        (height, width) 0..1, at the film's working size.

    Raises:
        InputError: no picture in it can be read.
    """
    pictures = film.sample(_FRAMES)
    if not pictures:
        raise InputError(f"{film.path}: no picture in it can be read")
    # Row by row: all pictures in grey at once take several times their memory.
    rows = [
        np.median([picture[row].mean(axis=1, dtype=np.float32) for picture in pictures], axis=0)
        for row in range(len(pictures[0]))
    ]
    return np.asarray(np.stack(rows) / 255, np.float32)
