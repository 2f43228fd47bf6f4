"""The keyboard in a picture: its plane, which keys are seen, and how certain that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS, key_name
from pianomime.short_repr import short_repr
from pianomime.video.keyboard.evidence import look_along
from pianomime.video.keyboard.geometry import (
    BLACK_FRONT,
    FAR,
    FRONT,
    LEFT_EDGE,
    WHITE_WIDTH,
    WHITES,
)
from pianomime.video.keyboard.lines import Lines, black_place, find_lines
from pianomime.video.keyboard.naming import Naming, namings
from pianomime.video.keyboard.plane import Plane, fit_plane
from pianomime.video.keyboard.refine import refine
from pianomime.video.keyboard.zones import Zones, find_zones
from pianomime.world.parameters import key_centres

_C1 = 2
"""Index of the lowest C among the white keys."""
_CLEAR = 2.0
"""Logarithm of odds by which a naming must be better than every other one to leave no doubt."""
_FEWEST_SEEN = 0.4
"""Least share of the keys in the picture whose edges must be seen: fewer are in a picture that is
blurred by a moving camera, or are no keys."""
_DARK = 0.4
"""Brightness of white keys below which a picture is made brighter."""


@dataclass(frozen=True, eq=False)
class Keyboard:
    """A keyboard found in a picture.

    Attributes:
        plane: plane of the keys' tops in the picture.
        seen: (88,) bool, keys whose edges were found in the picture.
        error_metres: median distance of the edges found from those of the world's keys [m].
        error_pixels: that distance in the picture [pixels].
        mirrored: whether the picture is mirrored.
        lowest_c: octave of the lowest C that is seen, 4 for the middle C; None if none is.
    """

    plane: Plane
    seen: NDArray[np.bool_]
    error_metres: float
    error_pixels: float
    mirrored: bool
    lowest_c: int | None

    __repr__ = short_repr

    def describe(self) -> str:
        """One line for the user: which keys were found, and how well their edges fit."""
        return f"{self.describe_keys()}, {self.describe_fit()}"

    def describe_fit(self) -> str:
        """How well the edges that were found fit those of the world's keys."""
        return f"edges within {self.error_metres * 1000:.1f} mm ({self.error_pixels:.1f} pixels)"

    def describe_keys(self) -> str:
        """Which keys were found; their edges would fit a wrong naming as well."""
        keys = np.flatnonzero(self.seen)
        mirror = ", mirrored" if self.mirrored else ""
        names = f"keys {key_name(int(keys[0]))} to {key_name(int(keys[-1]))}"
        return f"{names} ({len(keys)} of {KEYS}){mirror}"


def find_keyboards(
    picture: NDArray[np.float32], octave: int | None = None, mirrored: bool | None = None
) -> list[Keyboard]:
    """Find the keyboard in a picture.

    Args:
        picture: (height, width) brightness, 0..1, preferably without hands.
        octave: octave of the lowest C that is seen, 4 for the middle C, if it is known.
        mirrored: whether the picture is mirrored, if that is known.

    Returns:
        The keyboard in every way to name its keys that the picture allows, the likeliest first;
        only one where there is no doubt. Empty if there is no keyboard, or none of that octave.
    """
    lines = find_lines(picture)
    if lines is None:
        return []
    zones = find_zones(picture, lines)
    if zones is None:
        return []
    if zones.bright < _DARK:
        picture = np.minimum(picture * np.float32(0.7 / zones.bright), 1.0)
    plane, known = _rough_plane(lines, zones, picture.shape)
    ways: list[Naming] = []
    for _ in range(2):
        # The first time, keys beyond the octaves that were assumed are not used.
        refined = refine(picture, plane, known)
        if refined is None:
            return []
        evidence = look_along(picture, refined[0], known)
        ways = namings(evidence)
        if not ways:
            return []
        base, whites = refined[0], known
        likely = next(way for way in ways if not way.mirrored)
        plane, known = likely.apply(base), likely.renamed(known)
    ways = [
        way
        for way in ways
        if mirrored in (None, way.mirrored) and octave in (None, way.lowest_c(evidence))
    ]
    found = []
    for way in ways:
        clear = _CLEAR
        if ways[0].mirrored and not way.mirrored:
            # What hides keys may hide, or look like, the ends that tell of a mirror.
            clear += evidence.hidden()
        if way.score < ways[0].score - clear:
            continue
        named = refine(picture, way.apply(base), way.renamed(whites))
        if named is not None and _fits(named[0], named[1], picture.shape):
            found.append(Keyboard(*named, way.mirrored, way.lowest_c(evidence)))
    return found


def _fits(plane: Plane, seen: NDArray[np.bool_], size: tuple[int, ...]) -> bool:
    """Whether enough of the keys that should be in a picture are seen in it."""
    pixels = plane.to_pixels(key_centres()[:, :2])
    inside = ((pixels > 0) & (pixels < size[::-1])).all(axis=1)
    return bool(seen.sum() >= _FEWEST_SEEN * inside.sum())


def _middle(lines: Lines, zones: Zones, size: tuple[int, ...]) -> float:
    """Coordinate u in the middle of the part of the keyboard's line that is in the picture."""
    u = np.arange(-200.0, 200.0, 0.5)
    at = lines.pixels(u, np.full(len(u), (zones.far + zones.front) / 2))
    inside = ((at > 0) & (at < size[::-1])).all(axis=1)
    middle = float(u[inside].mean())
    # A keyboard that is a small part of the picture is where its black keys are.
    found = np.asarray(black_place(lines.blacks[[0, -1]]))
    spare = max(0.0, float(len(WHITES) - (found[1] - found[0])) / 2)
    return float(np.clip(middle, found.mean() - spare, found.mean() + spare))


def _rough_plane(
    lines: Lines, zones: Zones, size: tuple[int, ...]
) -> tuple[Plane, NDArray[np.int64]]:
    """The plane through the outermost black keys found, in the octave that fits the picture best.

    Returns:
        The plane, and the numbers of the first and the last white key between these black keys.
    """
    # u = 0 is the left edge of some C. Bass to treble runs along the line, or against it where the
    # player, who has the bass at the left, sits on the other side; then it is u = 3.
    turned = zones.front < zones.far
    direction = -1 if turned else 1
    u = np.asarray(black_place(lines.blacks[[0, -1]]))
    first = _C1 + (3.0 if turned else 0.0)
    off_middle = len(WHITES) / 2 - (first + direction * _middle(lines, zones, size))
    first += 7 * round(off_middle / 7)
    pixels, world = [], []
    for r, x in ((zones.far, FAR), (zones.black_front, BLACK_FRONT), (zones.front, FRONT)):
        for place in u:
            pixels.append(lines.pixels(np.array(place), np.array(r)))
            world.append([x, LEFT_EDGE + WHITE_WIDTH * (first + direction * place)])
    known = np.sort(np.floor(first + direction * u).astype(np.int64))
    return fit_plane(np.array(pixels), np.array(world)), known
