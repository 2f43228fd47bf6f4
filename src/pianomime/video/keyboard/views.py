"""The ways to see the keyboard of a film: where it is in each frame, and how its keys are named."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.progress import Progress
from pianomime.short_repr import short_repr
from pianomime.video.film.background import median_of, sampled
from pianomime.video.film.film import Film
from pianomime.video.keyboard.following import Stretch, follow_keyboard, stands_still
from pianomime.video.keyboard.geometry import FAR, FRONT, LEFT_EDGE, WHITE_WIDTH, WHITES
from pianomime.video.keyboard.keyboard import Keyboard, find_keyboards
from pianomime.video.keyboard.lines import sample
from pianomime.video.keyboard.plane import Plane
from pianomime.video.keyboard.points import NamedPoints
from pianomime.video.keyboard.track import KeyboardTrack

_ACROSS = np.linspace(2 * FAR, 1.5 * FRONT, 60)
_ALONG = LEFT_EDGE + WHITE_WIDTH * np.linspace(-3, len(WHITES) + 3, 900)
"""[m] World x and y of the points at which stretches are compared: on and around the keyboard."""
_LEAST_COMMON = 0.1
"""Least share of these points that must be in both pictures."""
_CLEARLY = 0.02
"""Correlation by which one naming must be more like the known one than all others."""


@dataclass(frozen=True, eq=False)
class View:
    """A way to see the keyboard in a film.

    Attributes:
        track: where it is, from pixels of the pictures as they are read to the world.
        description: one line.
        namings: the keyboard in each way to name its keys, the likeliest first.
        guessed: stretches of the film whose octave is a guess: first frame, and keyboard.
    """

    track: KeyboardTrack
    description: str
    namings: tuple[Keyboard, ...] = ()
    guessed: tuple[tuple[int, Keyboard], ...] = ()

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class _Found:
    """A stretch of a film, and the keyboard in it in each way to name its keys."""

    stretch: Stretch
    keyboards: list[Keyboard]


def view_of_points(points: NamedPoints, film: Film) -> View:
    """The keyboard where a person has marked it, of a camera that does not move."""
    return View(KeyboardTrack.still(points.plane.zoomed(1 / film.zoom)), points.describe_points())


def find_views(
    film: Film, most: int, octave: int | None, mirrored: bool | None, progress: Progress
) -> list[View]:
    """Find the keyboard in a film.

    Args:
        film: the film.
        most: number of frames, at 20 Hz, after which it ends.
        octave: octave of the lowest C that is seen, if it is known.
        mirrored: whether the film is mirrored, if that is known.
        progress: called in the phase "keyboard", frame by frame where the camera moves.

    Returns:
        The ways to see the keyboard, the likeliest first: one, or one for each possible naming;
        none if no keyboard is found.
    """
    progress("keyboard", 0, 0)
    pictures = sampled(film)
    background = median_of(pictures)
    keyboards = find_keyboards(background, octave, mirrored)
    if keyboards and stands_still(pictures, background, keyboards[0].plane):
        return [
            View(KeyboardTrack.still(keyboard.plane), keyboard.describe_keys(), tuple(keyboards))
            for keyboard in keyboards
        ]
    del pictures
    stretches, frames = follow_keyboard(film, most, progress)
    found = []
    for stretch in stretches:
        # Keys are named in a picture without hands, unless it is too blurred.
        named = find_keyboards(median_of([stretch.background]), octave, mirrored)
        if not named and octave is None and mirrored is None:
            named = list(stretch.keyboards)
        if named:
            found.append(_Found(stretch, named))
    if not found:
        return []
    # The stretch that leaves least open tells how the others are named.
    anchor = max(found, key=lambda each: (-len(each.keyboards), len(each.stretch.frames)))
    return [_view(found, anchor, keyboard, frames) for keyboard in anchor.keyboards]


def _view(found: list[_Found], anchor: _Found, keyboard: Keyboard, frames: int) -> View:
    """The view in which a stretch is named in one of its ways, and the others like it."""
    which = np.full(frames, -1, np.int64)
    planes: list[Plane] = []
    backgrounds = []
    guessed = []
    for each in found:
        named, sure = (keyboard, True) if each is anchor else _named_like(anchor, keyboard, each)
        if not sure:
            guessed.append((int(each.stretch.frames[0]), named))
        for frame, moved in zip(each.stretch.frames, each.stretch.moved, strict=True):
            which[frame] = len(planes)
            planes.append(Plane(named.plane.matrix @ np.linalg.inv(moved)))
        backgrounds.append((each.stretch.background, named.plane))
    told = f"{keyboard.describe_keys()}, followed through {_pictures(found)}"
    track = KeyboardTrack(tuple(planes), which, tuple(backgrounds))
    return View(track, told, tuple(anchor.keyboards), tuple(guessed))


def _pictures(found: list[_Found]) -> str:
    return "moving pictures" if len(found) == 1 else f"{len(found)} views"


def _named_like(anchor: _Found, keyboard: Keyboard, other: _Found) -> tuple[Keyboard, bool]:
    """The naming of another stretch in which it looks most like a known one; whether that is sure.

    What is on and around the keys, such as a logo, a lamp or a shade, tells one octave from others.
    """
    if len(other.keyboards) == 1:
        return other.keyboards[0], True
    x, y = np.meshgrid(_ACROSS, _ALONG, indexing="ij")
    places = np.stack((x, y), axis=-1)
    known = _seen(anchor.stretch.background, keyboard.plane, places)
    likeness = np.array(
        [
            _correlation(known, _seen(other.stretch.background, way.plane, places))
            for way in other.keyboards
        ]
    )
    best = int(likeness.argmax())
    second = np.partition(likeness, -2)[-2]
    return other.keyboards[best], bool(likeness[best] > second + _CLEARLY)


def _seen(
    picture: NDArray[np.uint8], plane: Plane, places: NDArray[np.float64]
) -> NDArray[np.float64]:
    return sample(median_of([picture]), plane.to_pixels(places))


def _correlation(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Of the brightness at points that are in both pictures; -1 if they are few."""
    both = np.isfinite(first) & np.isfinite(second)
    if both.mean() < _LEAST_COMMON:
        return -1.0
    return float(np.corrcoef(first[both], second[both])[0, 1])
