"""The keyboard in a picture: its plane, which keys are seen, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from pianomime.keyboard import BLACK, KEYS, key_name
from pianomime.video.keyboard.plane import Plane, fit_plane
from pianomime.video.keyboard.search import (
    Lines,
    black_place,
    find_lines,
    line_through,
    sample,
)
from pianomime.world.parameters import key_centres, key_half_sizes

WHITE_WIDTH = 0.0235
"""[m] from one white key to the next in the world."""

_WHITES = np.flatnonzero(~BLACK)
_C1 = 2
"""Number of the lowest C among the white keys."""
FAR, FRONT = -0.075, 0.075
"""[m] world x of the two ends of the white keys."""
BLACK_FRONT = float(key_centres()[1, 0] + key_half_sizes()[1, 0])
"""[m] world x where the black keys end toward the player."""
_MOST_DOUBT = 0.25
"""Black keys, of those found, that may be missing or too many."""
_OFF_LINE = 0.003
"""[m]"""
LEFT_EDGE = float(key_centres()[0, 1]) - WHITE_WIDTH / 2
"""[m] world y of the left edge of the lowest key."""


@dataclass(frozen=True, eq=False)
class Keyboard:
    """One way to see a keyboard in a picture.

    Attributes:
        plane: from the picture's pixels to the world.
        seen: (88,) bool, the keys whose edges were found in the picture.
        error_metres: median distance between where edges are found and where the plane has them.
        error_pixels: the same in the picture.
        mirrored: the picture shows the keyboard as in a mirror.
        doubt: how much speaks against this way of several; the least is the best.
    """

    plane: Plane
    seen: NDArray[np.bool_]
    error_metres: float
    error_pixels: float
    mirrored: bool
    doubt: float

    def describe(self) -> str:
        """One line for a person."""
        keys = np.flatnonzero(self.seen)
        mirror = ", mirrored" if self.mirrored else ""
        return (
            f"keys {key_name(int(keys[0]))} to {key_name(int(keys[-1]))} "
            f"({len(keys)} of {KEYS}){mirror}, edges within {self.error_metres * 1000:.1f} mm "
            f"({self.error_pixels:.1f} pixels)"
        )


def find_keyboards(picture: NDArray[np.float32]) -> list[Keyboard]:
    """The keyboard in a grey picture (height, width), 0..1, without hands in it if possible.

    Returns:
        Every way to name its octaves that the picture allows, the likeliest first: where the
        whole keyboard is seen there is one. Empty if there is no keyboard.
    """
    lines = find_lines(picture)
    if lines is None:
        return []
    zones = _find_zones(picture, lines)
    if zones is None:
        return []
    found = []
    for mirrored in (False, True):
        # Bass to treble runs along the line or against it: from where the player sits, the bass
        # is to the left.
        flipped = (zones.front < zones.far) != mirrored
        for name in _namings(picture, lines, zones, flipped):
            rough = _rough_plane(lines, zones, name)
            refined = _refine(picture, rough)
            if refined is not None:
                plane, seen, metres, pixels = refined
                found.append(Keyboard(plane, seen, metres, pixels, mirrored, name.doubt))
    # A mirror only where nothing else explains what is seen: half a keyboard looks the same.
    found.sort(key=lambda way: (way.doubt + 0.5 * way.mirrored, way.error_metres))
    if not found or found[0].doubt > _MOST_DOUBT * len(lines.blacks):
        return []
    return [way for way in found if way.doubt <= found[0].doubt + 1.0]


@dataclass(frozen=True)
class _Zones:
    """r of the far end of the keys, of the front of the black ones and of the white ones."""

    far: float
    black_front: float
    front: float


def _find_zones(picture: NDArray[np.float32], lines: Lines) -> _Zones | None:
    height, width = picture.shape
    reach = np.hypot(height, width) / 2
    unit = abs(float(lines.width[0]))
    r = np.arange(max(-reach, lines.rows[0] - 12 * unit), min(reach, lines.rows[1] + 12 * unit))
    first, last = int(lines.blacks[0]), int(lines.blacks[-1])
    low, high = np.floor(black_place(lines.blacks[[0, -1]]) / 7).astype(int)
    octaves = np.arange(low, high + 1)
    # Between E and F and between B and C there is white from end to end.
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
    # White keys go on beyond the black ones on the player's side only, with a dark line at every
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
        worth = float(np.median(level)) / bright + 4 * float(np.nanmedian(lined[near]))
        if np.isfinite(worth) and (best is None or worth > best[0]):
            best = worth, side
    if best is None or best[0] < 0.4:
        return None
    side = best[1]
    black_front, far = (black_zone[1], black_zone[0]) if side == 1 else black_zone
    # The white keys end where brightness, or their lines, change most.
    ends = black_front + side * np.arange(round(0.35 * length), round(0.95 * length) + 1)
    ends = ends[(ends >= 2) & (ends < len(r) - 2)]
    if len(ends) < 3:
        return None
    level = np.nan_to_num(white_level)
    drop = np.abs(level[ends - 2] - level[ends + 2])
    front = int(ends[int(np.argmax(drop))])
    if drop.max() < 0.08:
        # No visible end, for it may lie outside the picture: as long as keys are.
        front = int(np.clip(black_front + side * 0.6 * length, 0, len(r) - 1))
    return _Zones(float(r[far]), float(r[black_front]), float(r[front]))


def _row_level(
    picture: NDArray[np.float32],
    lines: Lines,
    u: NDArray[np.float64],
    r: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(R,) median brightness at places u, for each r; NaN outside the picture."""
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
    """Which key is which: white key edge n of the keyboard is at u = (n - first) * direction."""

    first: float
    direction: int
    doubt: float


def _namings(
    picture: NDArray[np.float32], lines: Lines, zones: _Zones, flipped: bool
) -> list[_Naming]:
    """Every way to count octaves, with what speaks against it, the best within 1."""
    model = _black_edges()
    found = np.asarray(black_place(lines.blacks))
    height, width = picture.shape
    row = (zones.far + zones.black_front) / 2
    ways = []
    for octave in range(-12, 13):
        # u = 0 is the left edge of some C; in a mirror u = 3 is, counted to the left.
        direction = -1 if flipped else 1
        first = _C1 + 7.0 * octave + (3.0 if flipped else 0.0)
        n = first + direction * found
        # Black keys found where the keyboard has none, and those that it has, within the picture
        # and within what was found or well beside it, that were not found.
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
        # All else being equal, the middle of the picture is near the middle of the keyboard.
        centre = float(np.mean(n))
        ways.append(_Naming(first, direction, doubt + abs(centre - 26) / 100))
    best = min(way.doubt for way in ways)
    return [way for way in ways if way.doubt <= best + 1.0]


def _black_edges() -> NDArray[np.float64]:
    """(36,) where the black keys lie, in white keys from the left edge of the lowest key."""
    return np.asarray((key_centres()[BLACK, 1] - LEFT_EDGE) / WHITE_WIDTH)


def _rough_plane(lines: Lines, zones: _Zones, naming: _Naming) -> Plane:
    u = np.array(black_place(lines.blacks[[0, -1]]))
    pixels, world = [], []
    for r, x in ((zones.far, FAR), (zones.black_front, BLACK_FRONT), (zones.front, FRONT)):
        for place in u:
            pixels.append(lines.pixels(np.array(place), np.array(r)))
            n = naming.first + naming.direction * place
            world.append([x, LEFT_EDGE + WHITE_WIDTH * n])
    return fit_plane(np.array(pixels), np.array(world))


def _refine(
    picture: NDArray[np.float32], plane: Plane
) -> tuple[Plane, NDArray[np.bool_], float, float] | None:
    """Fit the plane to the edges of keys, found to a fraction of a pixel near where it has them.

    An edge says where it is across itself, nothing of where along.
    """
    seen = np.zeros(KEYS, bool)
    for window in (0.4, 0.25, 0.2):
        edges = _find_edges(picture, plane, window)
        if len(edges.pixels) < 12:
            return None

        def residual(free: NDArray[np.float64], edges: _Edges = edges) -> NDArray[np.float64]:
            world = Plane(np.append(free, 1.0).reshape(3, 3)).to_world(edges.pixels)
            off = world[np.arange(len(world)), edges.axis] - edges.value
            return np.asarray(1000 * off * edges.weight)

        scale = plane.matrix / plane.matrix[2, 2]
        start = scale.ravel()[:8]
        # The columns differ by orders of magnitude.
        solution = least_squares(residual, start, loss="soft_l1", x_scale="jac", max_nfev=60)
        if not np.isfinite(solution.x).all():
            return None
        plane = Plane(np.append(solution.x, 1.0).reshape(3, 3))
        seen = edges.seen
    edges = _find_edges(picture, plane, 0.2)
    if len(edges.pixels) < 12:
        return None
    world = plane.to_world(edges.pixels)
    off = np.abs(world[np.arange(len(world)), edges.axis] - edges.value)
    metres = float(np.median(off))
    sizes = np.linalg.norm(
        plane.to_pixels([[0, 0.1], [0.05, 0]]) - plane.to_pixels([[0, -0.1], [-0.05, 0]]), axis=1
    ) / (0.2, 0.1)
    return plane, seen, metres, metres * float(sizes.mean())


@dataclass(frozen=True, eq=False)
class _Edges:
    """Places (E, 2) where the picture shows an edge whose world x (axis 0) or y (axis 1) is known.

    Attributes:
        pixels: (E, 2) column, row.
        axis: (E,) int.
        value: (E,) [m].
        weight: (E,).
        seen: (88,) keys with an edge.
    """

    pixels: NDArray[np.float64]
    axis: NDArray[np.int64]
    value: NDArray[np.float64]
    weight: NDArray[np.float64]
    seen: NDArray[np.bool_]


def _find_edges(picture: NDArray[np.float32], plane: Plane, window: float) -> _Edges:
    """Look for edges within `window` white keys of where a plane has them."""
    pixels, axis, value, weight = [], [], [], []
    seen = np.zeros(KEYS, bool)
    span = np.linspace(-window, window, 33) * WHITE_WIDTH
    # Dark lines between white keys, in front of the black ones.
    whites = LEFT_EDGE + WHITE_WIDTH * np.arange(1, len(_WHITES))
    rows = np.linspace(BLACK_FRONT + 0.012, FRONT - 0.008, 6)
    gap, row = (each.ravel() for each in np.meshgrid(np.arange(len(whites)), rows, indexing="ij"))
    world = np.stack(np.broadcast_arrays(row[:, None], whites[gap][:, None] + span), axis=-1)
    profile = sample(picture, plane.to_pixels(world))
    place, depth = _dip(profile, span)
    good = depth > 0.02
    pixels.append(plane.to_pixels(np.stack([row[good], whites[gap[good]] + place[good]], axis=-1)))
    axis.append(np.ones(good.sum(), int))
    value.append(whites[gap[good]])
    weight.append(np.full(good.sum(), 1.0))
    found = np.bincount(gap[good], minlength=len(whites)) >= 2
    seen[_WHITES[:-1][found]] = seen[_WHITES[1:][found]] = True
    # Ends: of black keys toward the player, of white keys toward the player and away.
    free = np.array(
        [
            y
            for white in range(len(_WHITES) - 1)
            if _WHITES[white + 1] == _WHITES[white] + 1
            for y in whites[white] + np.array([-0.25, 0.25]) * WHITE_WIDTH
        ]
    )
    blacks = key_centres()[BLACK, 1]
    centres = key_centres()[_WHITES, 1]
    # Wide, and of less weight, for black keys are longer on most pianos than on the world's.
    reach = np.linspace(-0.013, 0.013, 53)
    for x, along, sign, trust in (
        (BLACK_FRONT, blacks, 1, 0.23),
        (FRONT, centres, -1, 0.33),
        # Lids and glow make the far end doubtful.
        (FAR, free, 1, 0.23),
    ):
        world = np.stack(np.broadcast_arrays(x + reach, along[:, None]), axis=-1)
        profile = sample(picture, plane.to_pixels(world))
        place, height = _step(sign * profile, reach)
        good = height > 0.06
        if good.sum() > 3:
            # The edges of all keys are in one line; what is not is a shelf or a shadow.
            at, slope = line_through(along[good], place[good])
            good &= np.abs(place - at - slope * along) < _OFF_LINE
        pixels.append(plane.to_pixels(np.stack([x + place[good], along[good]], axis=-1)))
        axis.append(np.zeros(good.sum(), int))
        value.append(np.full(good.sum(), x))
        weight.append(np.full(good.sum(), trust))
        if x == BLACK_FRONT:
            seen[np.flatnonzero(BLACK)[good]] = True
    return _Edges(
        np.concatenate(pixels),
        np.concatenate(axis),
        np.concatenate(value),
        np.concatenate(weight),
        seen,
    )


def _dip(
    profile: NDArray[np.float64], at: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where each profile (P, S) is darkest, between samples, and how deep the dip is."""
    complete = np.asarray(np.isfinite(profile).all(axis=1))
    filled = np.where(complete[:, None], profile, 0.0)
    lowest = np.clip(filled.argmin(axis=1), 1, len(at) - 2)
    place = at[lowest] + _vertex(filled, lowest) * (at[1] - at[0])
    third = len(at) // 3
    shoulder = np.minimum(filled[:, :third].max(axis=1), filled[:, -third:].max(axis=1))
    depth = np.where(complete, shoulder - filled.min(axis=1), 0.0)
    # A dip at the very end belongs to something else.
    inner = (lowest > 2) & (lowest < len(at) - 3)
    return place, np.where(inner, depth, 0.0)


def _step(
    profile: NDArray[np.float64], at: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where each profile (P, S) rises most, between samples, and by how much."""
    complete = np.asarray(np.isfinite(profile).all(axis=1))
    filled = np.where(complete[:, None], profile, 0.0)
    wide = max(2, len(at) // 12)
    rise = filled[:, 2 * wide :] - filled[:, : -2 * wide]
    steepest = np.clip(rise.argmax(axis=1), 1, rise.shape[1] - 2)
    place = at[steepest + wide] + _vertex(-rise, steepest) * (at[1] - at[0])
    height = np.take_along_axis(rise, steepest[:, None], axis=1)[:, 0]
    inner = (steepest > 1) & (steepest < rise.shape[1] - 2)
    return place, np.where(complete & inner, height, 0.0)


def _vertex(profile: NDArray[np.float64], lowest: NDArray[np.int64]) -> NDArray[np.float64]:
    """Offset (P,) of the minimum of the parabola through three samples, in samples."""
    row = np.arange(len(profile))
    before, here, after = (profile[row, lowest + step] for step in (-1, 0, 1))
    curve = before - 2 * here + after
    return np.where(curve > 0, 0.5 * (before - after) / np.where(curve > 0, curve, 1.0), 0.0)
