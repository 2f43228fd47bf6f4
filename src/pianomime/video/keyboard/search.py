"""The search for a keyboard in a file, which may be a picture or a film."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE
from pianomime.progress import Progress
from pianomime.short_repr import short_repr
from pianomime.video.film.background import median_of, sampled
from pianomime.video.film.film import Film
from pianomime.video.film.still import read_still
from pianomime.video.keyboard.keyboard import find_keyboards
from pianomime.video.keyboard.told import named_as_told
from pianomime.video.keyboard.track import KeyboardTrack
from pianomime.video.keyboard.views import MOST_FRAMES, View, find_views


@dataclass(frozen=True, eq=False)
class Searched:
    """A picture, and the keyboard in it.

    Attributes:
        picture: (height, width, 3) uint8, at the working size: the picture itself, or one of the
            film, in which the planes of `view.namings` are.
        zoom: size of the picture as it was given, divided by the working size.
        view: the likeliest way to see the keyboard; None if there is none.
    """

    picture: NDArray[np.uint8]
    zoom: float
    view: View | None

    __repr__ = short_repr

    @property
    def second(self) -> float | None:
        """When a film shows the picture [s]; None where the keyboard is in one place in it."""
        frame = None if self.view is None else self.view.frame
        return None if frame is None else frame / FRAME_RATE


def search_keyboard(
    path: Path, octave: int | None, mirrored: bool | None, progress: Progress
) -> Searched:
    """Search the keyboard in a picture or a film.

    Args:
        path: the file.
        octave: octave of the lowest C that is seen, 4 for the middle C, if it is known.
        mirrored: whether it is mirrored, if that is known.
        progress: called in the phase "keyboard", frame by frame where the camera of a film moves.

    Raises:
        InputError: the file cannot be read as either.
    """
    still = read_still(path)
    if still is None:
        film = Film(path)
        views = find_views(film, MOST_FRAMES, octave, mirrored, progress)
        picture = views[0].picture if views else None
        if picture is None:
            pictures = sampled(film)
            picture = pictures[len(pictures) // 2]
        return Searched(picture, film.zoom, views[0] if views else None)
    brightness = median_of([still.picture])
    untold = find_keyboards(brightness)
    named = named_as_told(untold, brightness, octave, mirrored)
    view = None
    if named:
        track, description = KeyboardTrack.still(named[0].plane), named[0].describe_keys()
        view = View(track, description, tuple(named), tuple(untold))
    return Searched(still.picture, still.zoom, view)
