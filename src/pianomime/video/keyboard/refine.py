"""Refinement of a keyboard's plane: a robust, sub-pixel fit to the edges of its keys."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from pianomime.keyboard import BLACK, KEYS
from pianomime.video.keyboard.geometry import (
    BLACK_FRONT,
    FAR,
    FRONT,
    LEFT_EDGE,
    WHITE_WIDTH,
    WHITES,
)
from pianomime.video.keyboard.lines import line_through, sample
from pianomime.video.keyboard.plane import Plane
from pianomime.world.parameters import key_centres

_OFF_LINE = 0.003
"""[m] Edges further than this from the line through those of all keys are not of keys."""
_LIT, _DARKEST = 0.5, 0.15
"""Brightness from which on all of an edge's contrast counts, and the least part of it that does
where it is darker: a part of the keyboard may lie in shade."""


def refine(
    picture: NDArray[np.float32], plane: Plane, known: NDArray[np.int64]
) -> tuple[Plane, NDArray[np.bool_], float, float] | None:
    """Fit a plane to the edges of keys that are found near those that it predicts.

    An edge determines only the coordinate perpendicular to it.

    Args:
        picture: (height, width) brightness, 0..1.
        plane: a first guess.
        known: (2,) numbers of the first and the last white key near which the guess is good.

    Returns:
        The plane, (88,) bool the keys with edges, and the median error [m] and [pixels]; None if
        too few edges are found.
    """
    seen = np.zeros(KEYS, bool)
    middle, half = known.mean() + 0.5, float(known[1] - known[0] + 1) / 2
    # From the middle outward, since a guess that is wrong by half a key at the ends, as in pictures
    # through wide lenses, would take each edge for its neighbour there.
    for window, part in ((0.4, 0.5), (0.4, 0.75), (0.3, 1.0), (0.25, np.inf), (0.2, np.inf)):
        reach = LEFT_EDGE + WHITE_WIDTH * (middle + np.array([-1, 1]) * part * half)
        edges = _find_edges(picture, plane, window, reach)
        if len(edges.pixels) < 12:
            return None

        def residual(free: NDArray[np.float64], edges: _Edges = edges) -> NDArray[np.float64]:
            world = Plane(np.append(free, 1.0).reshape(3, 3)).to_world(edges.pixels)
            off = world[np.arange(len(world)), edges.axis] - edges.value
            return np.asarray(1000 * off * edges.weight)

        scale = plane.matrix / plane.matrix[2, 2]
        start = scale.ravel()[:8]
        # The parameters differ by orders of magnitude, hence x_scale.
        solution = least_squares(residual, start, loss="soft_l1", x_scale="jac", max_nfev=60)
        if not np.isfinite(solution.x).all():
            return None
        plane = Plane(np.append(solution.x, 1.0).reshape(3, 3))
        seen = edges.seen
    edges = _find_edges(picture, plane, 0.2, np.array([-np.inf, np.inf]))
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
    """E points on edges in the picture, of each of which one world coordinate is known.

    Attributes:
        pixels: (E, 2) column, row.
        axis: (E,) int; 0 if world x is known, 1 if world y is.
        value: (E,) that coordinate [m].
        weight: (E,) weight of its error.
        seen: (88,) bool, keys with an edge.
    """

    pixels: NDArray[np.float64]
    axis: NDArray[np.int64]
    value: NDArray[np.float64]
    weight: NDArray[np.float64]
    seen: NDArray[np.bool_]


def _find_edges(
    picture: NDArray[np.float32], plane: Plane, window: float, reach: NDArray[np.float64]
) -> _Edges:
    """Find edges of keys within `window` widths of a white key from those that a plane predicts.

    Args:
        picture: (height, width) brightness, 0..1.
        plane: the plane.
        window: [white keys].
        reach: (2,) least and greatest world y of the keys [m].
    """
    pixels, axis, value, weight = [], [], [], []
    seen = np.zeros(KEYS, bool)
    span = np.linspace(-window, window, 33) * WHITE_WIDTH
    # Dark lines between white keys, in front of the black ones.
    whites = LEFT_EDGE + WHITE_WIDTH * np.arange(1, len(WHITES))
    rows = np.linspace(BLACK_FRONT + 0.012, FRONT - 0.008, 6)
    gap, row = (each.ravel() for each in np.meshgrid(np.arange(len(whites)), rows, indexing="ij"))
    world = np.stack(np.broadcast_arrays(row[:, None], whites[gap][:, None] + span), axis=-1)
    profile = sample(picture, plane.to_pixels(world))
    place, depth = _dip(profile, span)
    near = (whites >= reach[0]) & (whites <= reach[1])
    good = (depth > 0.02 * _lit(profile)) & near[gap]
    pixels.append(plane.to_pixels(np.stack([row[good], whites[gap[good]] + place[good]], axis=-1)))
    axis.append(np.ones(good.sum(), int))
    value.append(whites[gap[good]])
    weight.append(np.full(good.sum(), 1.0))
    found = np.bincount(gap[good], minlength=len(whites)) >= 2
    seen[WHITES[:-1][found]] = seen[WHITES[1:][found]] = True
    # Ends of black keys toward the player, and of white keys toward and away from the player.
    free = np.array(
        [
            y
            for white in range(len(WHITES) - 1)
            if WHITES[white + 1] == WHITES[white] + 1
            for y in whites[white] + np.array([-0.25, 0.25]) * WHITE_WIDTH
        ]
    )
    blacks = key_centres()[BLACK, 1]
    centres = key_centres()[WHITES, 1]
    # In a wide window and with less weight, since black keys of most pianos are longer than those
    # of the world.
    off = np.linspace(-0.013, 0.013, 53)
    for x, along, sign, trust in (
        (BLACK_FRONT, blacks, 1, 0.23),
        (FRONT, centres, -1, 0.33),
        # Lids and glow make the far end uncertain.
        (FAR, free, 1, 0.23),
    ):
        world = np.stack(np.broadcast_arrays(x + off, along[:, None]), axis=-1)
        profile = sample(picture, plane.to_pixels(world))
        place, height = _step(sign * profile, off)
        good = (height > 0.06 * _lit(profile)) & (along >= reach[0]) & (along <= reach[1])
        if good.sum() > 3:
            # The edges of all keys are on one line; edges off that line are of a shelf or a shadow.
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


def _lit(profile: NDArray[np.float64]) -> NDArray[np.float64]:
    """(P,) Part of the contrast that brightness profiles (P, S) have in full light."""
    brightest = np.nan_to_num(profile).max(axis=1)
    return np.asarray(np.clip(brightest / _LIT, _DARKEST, 1.0))


def _dip(
    profile: NDArray[np.float64], at: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(P,) Position of the minimum of each brightness profile (P, S), and its depth."""
    complete = np.asarray(np.isfinite(profile).all(axis=1))
    filled = np.where(complete[:, None], profile, 0.0)
    lowest = np.clip(filled.argmin(axis=1), 1, len(at) - 2)
    place = at[lowest] + _vertex(filled, lowest) * (at[1] - at[0])
    third = len(at) // 3
    shoulder = np.minimum(filled[:, :third].max(axis=1), filled[:, -third:].max(axis=1))
    depth = np.where(complete, shoulder - filled.min(axis=1), 0.0)
    # A minimum at the very end belongs to something else.
    inner = (lowest > 2) & (lowest < len(at) - 3)
    return place, np.where(inner, depth, 0.0)


def _step(
    profile: NDArray[np.float64], at: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(P,) Position of the steepest rise of each brightness profile (P, S), and its height."""
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
    """(P,) Offset of the minimum of the parabola through three samples, in samples."""
    row = np.arange(len(profile))
    before, here, after = (profile[row, lowest + step] for step in (-1, 0, 1))
    curve = before - 2 * here + after
    return np.where(curve > 0, 0.5 * (before - after) / np.where(curve > 0, curve, 1.0), 0.0)
