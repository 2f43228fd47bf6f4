"""The ways to see the keyboard of a film: where it is in each frame, and how its keys are named."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE
from pianomime.music.score import MAX_SECONDS
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
from pianomime.video.keyboard.told import named_as_told
from pianomime.video.keyboard.track import KeyboardTrack

_ACROSS = np.linspace(2 * FAR, 1.5 * FRONT, 60)
_ALONG = LEFT_EDGE + WHITE_WIDTH * np.linspace(-3, len(WHITES) + 3, 900)
"""[m] World x and y of the points at which stretches are compared: on and around the keyboard."""
_LEAST_COMMON = 0.1
"""Least share of these points that must be in both pictures."""
_CLEARLY = 0.02
"""Correlation by which one naming must be more like the known one than all others."""
_BRIEF = 2.0
"""[s] In less time, hands stay where they are in all pictures of a stretch."""
MOST_FRAMES = int(MAX_SECONDS * FRAME_RATE) - 1
"""Frames of the longest score; a film may be longer than its header says."""
_TRIED = 5
"""About how many pictures of a film are looked at for what a user told, before it is followed."""


@dataclass(frozen=True, eq=False)
class View:
    """A way to see the keyboard in a film.

    Attributes:
        track: where it is, from pixels of the pictures as they are read to the world.
        description: one line.
        namings: the keyboard as it is named in this view, and then in each other way to name its
            keys that agrees with what a user told; none if a person has marked it.
        untold: the same as the picture shows it, whatever was told.
        frame: number of the frame in whose pixels `namings` and `untold` are; None if they are in
            those of all frames.
        picture: (height, width, 3) uint8, that frame, or one in the middle of the film.
        guessed: stretches of the film whose octave is a guess: first frame, and keyboard.
        turned: first frames of stretches that are mirrored while the others are not, or the other
            way round.
    """

    track: KeyboardTrack
    description: str
    namings: tuple[Keyboard, ...] = ()
    untold: tuple[Keyboard, ...] = ()
    frame: int | None = None
    picture: NDArray[np.uint8] | None = None
    guessed: tuple[tuple[int, Keyboard], ...] = ()
    turned: tuple[int, ...] = ()

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class _Found:
    """A stretch of a film, and the keyboard in it in each way to name its keys."""

    stretch: Stretch
    keyboards: list[Keyboard]
    clear: bool
    """Whether it was found in a picture without hands."""


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
        octave: octave of the lowest C that is seen, if it is known; where the camera moves, in the
            frame that a view names.
        mirrored: whether the film is mirrored, if that is known.
        progress: called in the phase "keyboard", frame by frame where the camera moves.

    Returns:
        The ways to see the keyboard, the likeliest first: one, or one for each possible naming;
        none if no keyboard is found.
    """
    progress("keyboard", 0, 0)
    pictures = sampled(film)
    background = median_of(pictures)
    untold = find_keyboards(background)
    if untold and stands_still(pictures, background, untold[0].plane):
        named = named_as_told(untold, background, octave, mirrored)
        return [
            View(
                KeyboardTrack.still(keyboard.plane),
                keyboard.describe_keys(),
                _first(keyboard, named),
                tuple(untold),
                picture=pictures[len(pictures) // 2],
            )
            for keyboard in named
        ]
    if (octave, mirrored) != (None, None) and _ruled_out(pictures, octave, mirrored):
        return []
    del pictures
    stretches, frames = follow_keyboard(film, most, progress)
    if not stretches:
        return []
    found = [_find(stretch) for stretch in stretches]
    # The stretch that leaves least open tells how the others are named; not one that is blurred.
    anchor = max(
        found, key=lambda each: (each.clear, -len(each.keyboards), len(each.stretch.frames))
    )
    background = median_of([anchor.stretch.background])
    named = named_as_told(anchor.keyboards, background, octave, mirrored)
    return [_view(found, anchor, keyboard, named, frames) for keyboard in named]


def _ruled_out(
    pictures: list[NDArray[np.uint8]], octave: int | None, mirrored: bool | None
) -> bool:
    """Whether pictures show a keyboard, and none of them one that can be named as it is told.

    That shows before the film is followed, which takes as long as the film.
    """
    seen = False
    for picture in pictures[:: max(1, len(pictures) // _TRIED)]:
        brightness = median_of([picture])
        untold = find_keyboards(brightness)
        if untold and named_as_told(untold, brightness, octave, mirrored):
            return False
        seen = seen or bool(untold)
    return seen


def _find(stretch: Stretch) -> _Found:
    """The keyboard in a stretch, in a picture without hands, unless that is too blurred."""
    keyboards = find_keyboards(median_of([stretch.background]))
    lasts = len(stretch.frames) >= _BRIEF * FRAME_RATE
    return _Found(stretch, keyboards or list(stretch.keyboards), bool(keyboards) and lasts)


def _view(
    found: list[_Found], anchor: _Found, keyboard: Keyboard, named: list[Keyboard], frames: int
) -> View:
    """The view in which a stretch is named in one of its ways, and the others like it."""
    which = np.full(frames, -1, np.int64)
    planes: list[Plane] = []
    backgrounds = []
    guessed, turned = [], []
    for each in found:
        like, sure = (keyboard, True) if each is anchor else _named_like(anchor, keyboard, each)
        first = int(each.stretch.frames[0])
        if not sure:
            guessed.append((first, like))
        if like.mirrored != keyboard.mirrored:
            turned.append(first)
        for frame, moved in zip(each.stretch.frames, each.stretch.moved, strict=True):
            which[frame] = len(planes)
            planes.append(Plane(like.plane.matrix @ np.linalg.inv(moved)))
        backgrounds.append((each.stretch.background, like.plane))
    return View(
        KeyboardTrack(tuple(planes), which, tuple(backgrounds)),
        f"{keyboard.describe_keys()}, followed through {_pictures(found)}",
        _first(keyboard, named),
        tuple(anchor.keyboards),
        int(anchor.stretch.frames[0]),
        anchor.stretch.background,
        tuple(guessed),
        tuple(turned),
    )


def _first(keyboard: Keyboard, named: list[Keyboard]) -> tuple[Keyboard, ...]:
    return (keyboard, *(other for other in named if other is not keyboard))


def _pictures(found: list[_Found]) -> str:
    return "moving pictures" if len(found) == 1 else f"{len(found)} stretches"


def _named_like(anchor: _Found, keyboard: Keyboard, other: _Found) -> tuple[Keyboard, bool]:
    """The naming of another stretch in which it looks most like a known one; whether that is sure.

    A film is mirrored as a whole. What is on and around the keys, such as a logo, a lamp or a
    shade, tells one octave from others.
    """
    ways = [way for way in other.keyboards if way.mirrored == keyboard.mirrored] or other.keyboards
    if len(ways) == 1:
        return ways[0], True
    x, y = np.meshgrid(_ACROSS, _ALONG, indexing="ij")
    places = np.stack((x, y), axis=-1)
    known = _seen(anchor.stretch.background, keyboard.plane, places)
    likeness = np.array(
        [_correlation(known, _seen(other.stretch.background, way.plane, places)) for way in ways]
    )
    best = int(likeness.argmax())
    second = np.partition(likeness, -2)[-2]
    return ways[best], bool(likeness[best] > second + _CLEARLY)


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
