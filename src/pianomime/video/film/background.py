"""The background of a video: what most of its pictures show, without hands and lights."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.video.film.film import Film

_PICTURES = 25


def background(film: Film) -> NDArray[np.float32]:
    """(height, width) The median of some pictures of a video, see `sampled` and `median_of`."""
    return median_of(sampled(film))


def sampled(film: Film) -> list[NDArray[np.uint8]]:
    """Some pictures of a video, of which the background is made.

    Args:
        film: the video.

    Returns:
        Pictures (height, width, 3) uint8 at the working size, at least one.

    Raises:
        InputError: none can be read.
    """
    pictures = film.sample(_PICTURES)
    if not pictures:
        raise InputError(f"{film.path}: no picture in it can be read")
    return pictures


def median_of(pictures: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
    """The median of pictures in grey.

    Args:
        pictures: at least one, (height, width, 3) uint8, all of one size.

    Returns:
        (height, width) brightness, 0..1.
    """
    # Row by row: all pictures in grey at once take several times their memory.
    rows = [
        np.median([picture[row].mean(axis=1, dtype=np.float32) for picture in pictures], axis=0)
        for row in range(len(pictures[0]))
    ]
    return np.asarray(np.stack(rows) / 255, np.float32)
