"""A still: a picture in a file, in which something is looked for."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps, UnidentifiedImageError

from pianomime.errors import InputError
from pianomime.short_repr import short_repr

_LARGEST = 1280
"""[pixels] Larger pictures are shrunk to this size, as those of films are."""


@dataclass(frozen=True, eq=False)
class Still:
    """A picture.

    Attributes:
        picture: (height, width, 3) uint8, at the working size.
        zoom: size of the picture as it was given, divided by the working size.
    """

    picture: NDArray[np.uint8]
    zoom: float

    __repr__ = short_repr


def read_still(path: str | os.PathLike[str]) -> Still | None:
    """Read a picture.

    Args:
        path: the file; the picture is turned as it asks for.

    Returns:
        The picture; None if the file is of another kind, such as a video.

    Raises:
        InputError: it cannot be read.
    """
    try:
        with Image.open(path) as image:
            turned = ImageOps.exif_transpose(image).convert("RGB")
    except UnidentifiedImageError:
        return None
    except FileNotFoundError:
        raise InputError(f"{Path(path)}: does not exist") from None
    except IsADirectoryError:
        raise InputError(f"{Path(path)}: is a folder, not a picture or a video") from None
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"{Path(path)}: cannot be read as a picture") from error
    zoom = max(1.0, max(turned.size) / _LARGEST)
    size = (max(1, round(turned.width / zoom)), max(1, round(turned.height / zoom)))
    picture = np.asarray(turned.resize(size, Image.Resampling.BOX), np.uint8)
    return Still(picture, zoom)
