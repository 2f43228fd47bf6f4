"""A still: a picture, or what a video shows most of the time, in which something is looked for."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from pianomime.errors import InputError
from pianomime.short_repr import short_repr
from pianomime.video.film.background import median_of, sampled
from pianomime.video.film.film import Film

_LARGEST = 1280
"""[pixels] Larger pictures are shrunk to this size, as those of films are."""


@dataclass(frozen=True, eq=False)
class Still:
    """A picture, and its brightness.

    Attributes:
        picture: (height, width, 3) uint8, at the working size.
        brightness: (height, width), 0..1.
        zoom: size of the picture as it was given, divided by the working size.
    """

    picture: NDArray[np.uint8]
    brightness: NDArray[np.float32]
    zoom: float

    __repr__ = short_repr


def read_still(path: str | os.PathLike[str]) -> Still:
    """Read a picture or a video.

    Args:
        path: the file; a picture is turned as it asks for.

    Raises:
        InputError: it cannot be read as either.
    """
    try:
        with Image.open(path) as image:
            turned = ImageOps.exif_transpose(image).convert("RGB")
    except UnidentifiedImageError:
        film = Film(path)
        pictures = sampled(film)
        return Still(pictures[len(pictures) // 2], median_of(pictures), film.zoom)
    except FileNotFoundError:
        raise InputError(f"{Path(path)}: does not exist") from None
    except IsADirectoryError:
        raise InputError(f"{Path(path)}: is a folder, not a picture or a video") from None
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"{Path(path)}: cannot be read as a picture") from error
    zoom = max(1.0, max(turned.size) / _LARGEST)
    size = (max(1, round(turned.width / zoom)), max(1, round(turned.height / zoom)))
    picture = np.asarray(turned.resize(size, Image.Resampling.BOX), np.uint8)
    return Still(picture, median_of([picture]), zoom)
