"""Zones across a keyboard: the far end of its keys, and the fronts of black and of white ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.video.keyboard.lines import Lines, black_place, sample

_CONTRAST = 0.1
"""Least difference of black and white keys, in the brightness of the white ones."""


@dataclass(frozen=True)
class Zones:
    """Coordinate r of the far end of the keys, and of the front of black and of white keys.

    Attributes:
        far: [pixels].
        black_front: [pixels].
        front: [pixels].
        bright: brightness of the white keys, 0..1.
    """

    far: float
    black_front: float
    front: float
    bright: float


def find_zones(picture: NDArray[np.float32], lines: Lines) -> Zones | None:
    """Find the ends of the keys from the brightness on and between them, for each r.

    Args:
        picture: (height, width) brightness, 0..1.
        lines: the keyboard along lines.

    Returns:
        The ends; None if black keys are not darker than white ones.
    """
    height, width = picture.shape
    reach = np.hypot(height, width) / 2
    unit = abs(float(lines.width[0]))
    r = np.arange(max(-reach, lines.rows[0] - 12 * unit), min(reach, lines.rows[1] + 12 * unit))
    first, last = int(lines.blacks[0]), int(lines.blacks[-1])
    low, high = np.floor(black_place(lines.blacks[[0, -1]]) / 7).astype(int)
    octaves = np.arange(low, high + 1)
    # Between E and F and between B and C, the white keys are not covered by black ones.
    free = (np.array([2.72, 3.28, -0.28, 0.28]) + 7 * octaves[:, None]).ravel()
    # Beside the middle of black keys, where in front of them there is no line between white keys.
    black = (black_place(np.arange(first, last + 1))[:, None] + [-0.15, 0.15]).ravel()
    white_level = _row_level(picture, lines, free, r)
    black_level = _row_level(picture, lines, black, r)
    contrast = np.nan_to_num(white_level - black_level)
    inside = (r >= lines.rows[0]) & (r <= lines.rows[1])
    if not inside.any():
        return None
    typical = float(np.median(contrast[inside]))
    bright = float(np.median(white_level[inside]))
    if not typical > _CONTRAST * bright:
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
        level = np.maximum(np.nan_to_num(white_level[near]), 0.01)
        lines_seen = np.median(np.nan_to_num(lined[near]) / level)
        # Light above the keys can be brighter than they are, but shows no lines.
        evidence = min(float(np.median(level)) / bright, 1.0)
        evidence += 4 * float(np.clip(lines_seen, 0, 0.3))
        if best is None or evidence > best[0]:
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
    if drop.max() < _CONTRAST * bright:
        # The end is not visible and may be outside the picture; the usual proportions are taken.
        front = int(np.clip(black_front + side * 0.6 * length, 0, len(r) - 1))
    return Zones(float(r[far]), float(r[black_front]), float(r[front]), bright)


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
