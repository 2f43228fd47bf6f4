"""The keyboard in a picture: its plane, which keys are seen, and how certain that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, KEYS, key_name
from pianomime.short_repr import short_repr
from pianomime.video.keyboard.geometry import BLACK_FRONT, FAR, FRONT, LEFT_EDGE, WHITE_WIDTH
from pianomime.video.keyboard.lines import Lines, black_place, find_lines, sample
from pianomime.video.keyboard.plane import Plane, fit_plane
from pianomime.video.keyboard.refine import refine
from pianomime.world.parameters import key_centres

_C1 = 2
"""Index of the lowest C among the white keys."""
_MOST_DOUBT = 0.25
"""Largest share of the black keys found that may be missing or unexpected."""


@dataclass(frozen=True, eq=False)
class Keyboard:
    """A keyboard found in a picture.

    Attributes:
        plane: plane of the keys' tops in the picture.
        seen: (88,) bool, keys whose edges were found in the picture.
        error_metres: median distance of the edges found from those of the world's keys [m].
        error_pixels: that distance in the picture [pixels].
        mirrored: whether the picture is mirrored.
        doubt: number of black keys missing or unexpected, for this octave; the least is the best.
    """

    plane: Plane
    seen: NDArray[np.bool_]
    error_metres: float
    error_pixels: float
    mirrored: bool
    doubt: float

    __repr__ = short_repr

    def describe(self) -> str:
        """One line for the user."""
        keys = np.flatnonzero(self.seen)
        mirror = ", mirrored" if self.mirrored else ""
        return (
            f"keys {key_name(int(keys[0]))} to {key_name(int(keys[-1]))} "
            f"({len(keys)} of {KEYS}){mirror}, edges within {self.error_metres * 1000:.1f} mm "
            f"({self.error_pixels:.1f} pixels)"
        )


def find_keyboards(picture: NDArray[np.float32]) -> list[Keyboard]:
    """Find the keyboard in a picture.

    Args:
        picture: (height, width) brightness, 0..1, preferably without hands.

    Returns:
        The keyboard in every octave that the picture allows, the likeliest first; only one where
        the whole keyboard is visible. Empty if there is no keyboard.
    """
    lines = find_lines(picture)
    if lines is None:
        return []
    zones = _find_zones(picture, lines)
    if zones is None:
        return []
    found = []
    for mirrored in (False, True):
        # Bass to treble runs along the line or against it: seen by the player, the bass is left.
        flipped = (zones.front < zones.far) != mirrored
        for name in _namings(picture, lines, zones, flipped):
            rough = _rough_plane(lines, zones, name)
            refined = refine(picture, rough)
            if refined is not None:
                plane, seen, metres, pixels = refined
                found.append(Keyboard(plane, seen, metres, pixels, mirrored, name.doubt))
    # Half a keyboard looks the same in a mirror, so that is assumed only if nothing else fits.
    found.sort(key=lambda way: (way.doubt + 0.5 * way.mirrored, way.error_metres))
    if not found or found[0].doubt > _MOST_DOUBT * len(lines.blacks):
        return []
    return [way for way in found if way.doubt <= found[0].doubt + 1.0]


@dataclass(frozen=True)
class _Zones:
    """Coordinate r of the far end of the keys, and of the front of black and of white keys."""

    far: float
    black_front: float
    front: float


def _find_zones(picture: NDArray[np.float32], lines: Lines) -> _Zones | None:
    """Find the ends of the keys from the brightness on and between them, for each r."""
    height, width = picture.shape
    reach = np.hypot(height, width) / 2
    unit = abs(float(lines.width[0]))
    r = np.arange(max(-reach, lines.rows[0] - 12 * unit), min(reach, lines.rows[1] + 12 * unit))
    first, last = int(lines.blacks[0]), int(lines.blacks[-1])
    low, high = np.floor(black_place(lines.blacks[[0, -1]]) / 7).astype(int)
    octaves = np.arange(low, high + 1)
    # Between E and F and between B and C, the white keys are not covered by black ones.
    free = (np.array([2.72, 3.28, -0.28, 0.28]) + 7 * octaves[:, None]).ravel()
    black = black_place(np.arange(first, last + 1))
    white_level = _row_level(picture, lines, free, r)
    black_level = _row_level(picture, lines, black, r)
    contrast = np.nan_to_num(white_level - black_level)
    inside = (r >= lines.rows[0]) & (r <= lines.rows[1])
    if not inside.any():
        return None
    typical = float(np.median(contrast[inside]))
    bright = float(np.median(white_level[inside]))
    if typical < 0.08:
        return None
    black_zone = _run(contrast > 0.5 * typical, np.flatnonzero(inside))
    # White keys extend beyond the black ones on the player's side only, with a dark line at every
    # edge.
    edges = np.arange(7 * low, 7 * (high + 1) + 1).astype(np.float64)
    middles = edges[:-1] + 0.5
    lined = _row_level(picture, lines, middles, r) - _row_level(picture, lines, edges, r)
    length = black_zone[1] - black_zone[0]
    best = None
    for side, border in ((1, black_zone[1]), (-1, black_zone[0])):
        near = border + side * np.arange(round(0.15 * length), round(0.45 * length) + 1)
        near = near[(near >= 0) & (near < len(r))]
        if len(near) < 3:
            continue
        level = np.nan_to_num(white_level[near])
        evidence = float(np.median(level)) / bright + 4 * float(np.nanmedian(lined[near]))
        if np.isfinite(evidence) and (best is None or evidence > best[0]):
            best = evidence, side
    if best is None or best[0] < 0.4:
        return None
    side = best[1]
    black_front, far = (black_zone[1], black_zone[0]) if side == 1 else black_zone
    # The white keys end where their brightness changes most.
    ends = black_front + side * np.arange(round(0.35 * length), round(0.95 * length) + 1)
    ends = ends[(ends >= 2) & (ends < len(r) - 2)]
    if len(ends) < 3:
        return None
    level = np.nan_to_num(white_level)
    drop = np.abs(level[ends - 2] - level[ends + 2])
    front = int(ends[int(np.argmax(drop))])
    if drop.max() < 0.08:
        # The end is not visible and may be outside the picture; the usual proportions are taken.
        front = int(np.clip(black_front + side * 0.6 * length, 0, len(r) - 1))
    return _Zones(float(r[far]), float(r[black_front]), float(r[front]))


def _row_level(
    picture: NDArray[np.float32],
    lines: Lines,
    u: NDArray[np.float64],
    r: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(R,) Median brightness at coordinates u, for each r; NaN outside the picture."""
    values = sample(picture, lines.pixels(u[None, :], np.repeat(r[:, None], len(u), axis=1)))
    level = np.full(len(r), np.nan)
    enough = np.isfinite(values).sum(axis=1) >= max(2, len(u) // 4)
    level[enough] = np.nanmedian(values[enough], axis=1)
    return level


def _run(good: NDArray[np.bool_], start: NDArray[np.int64]) -> tuple[int, int]:
    """First and last index of the run of good entries around the middle of `start`."""
    at = int(start[len(start) // 2])
    low = high = at
    while low > 0 and good[max(0, low - 3) : low].any():
        low -= 1
    while high < len(good) - 1 and good[high + 1 : high + 4].any():
        high += 1
    return low, high


@dataclass(frozen=True)
class _Naming:
    """An assignment of keys: edge n of the white keys is at u = (n - first) * direction."""

    first: float
    direction: int
    doubt: float


def _namings(
    picture: NDArray[np.float32], lines: Lines, zones: _Zones, flipped: bool
) -> list[_Naming]:
    """The assignments for all octaves whose doubt is at most 1 more than the least."""
    model = _black_edges()
    found = np.asarray(black_place(lines.blacks))
    height, width = picture.shape
    row = (zones.far + zones.black_front) / 2
    ways = []
    for octave in range(-12, 13):
        # u = 0 is the left edge of some C; in a mirrored picture u = 3, counted to the left.
        direction = -1 if flipped else 1
        first = _C1 + 7.0 * octave + (3.0 if flipped else 0.0)
        n = first + direction * found
        # Doubtful are black keys found where the keyboard has none, and black keys of the keyboard
        # inside the picture that were not found.
        nearest = np.abs(n[:, None] - model[None]).min(axis=1)
        strange = int((nearest > 0.4).sum())
        u = (model - first) * direction
        at = lines.pixels(u, np.full(len(u), row))
        margin = 0.6 * abs(float(lines.width[0]))
        visible = (
            (at[:, 0] > margin) & (at[:, 0] < width - margin) & (at[:, 1] > 0) & (at[:, 1] < height)
        )
        missed = visible & (np.abs(u[:, None] - found[None]).min(axis=1) > 0.4)
        doubt = strange + float(missed.sum())
        # Of equally doubtful octaves, the one nearest to the middle of the keyboard is likeliest.
        centre = float(np.mean(n))
        ways.append(_Naming(first, direction, doubt + abs(centre - 26) / 100))
    best = min(way.doubt for way in ways)
    return [way for way in ways if way.doubt <= best + 1.0]


def _black_edges() -> NDArray[np.float64]:
    """(36,) Positions of the black keys, in white keys from the left edge of the lowest key."""
    return np.asarray((key_centres()[BLACK, 1] - LEFT_EDGE) / WHITE_WIDTH)


def _rough_plane(lines: Lines, zones: _Zones, naming: _Naming) -> Plane:
    """The plane through the outermost black keys found, at the three ends of the keys."""
    u = np.array(black_place(lines.blacks[[0, -1]]))
    pixels, world = [], []
    for r, x in ((zones.far, FAR), (zones.black_front, BLACK_FRONT), (zones.front, FRONT)):
        for place in u:
            pixels.append(lines.pixels(np.array(place), np.array(r)))
            n = naming.first + naming.direction * place
            world.append([x, LEFT_EDGE + WHITE_WIDTH * n])
    return fit_plane(np.array(pixels), np.array(world))
