"""Registration: the homography from a keyboard in one picture to the same one in another picture.

The brightness of points on the keyboard is compared directly (Lucas and Kanade, with the inverse
composition of Baker and Matthews, "Lucas-Kanade 20 Years On", 2004). Hands and lights are outliers,
which a robust weight leaves out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter, map_coordinates

from pianomime.short_repr import short_repr
from pianomime.video.keyboard.geometry import FAR, FRONT, LEFT_EDGE, WHITE_WIDTH, WHITES
from pianomime.video.keyboard.plane import Plane, fit_plane

_WIDEST = 640
"""[pixels] About the longer side of the pictures that are compared."""
_BLURS = (3.0, 1.0)
"""[pixels] Blurs of the pictures, from coarse to fine: a coarse one finds what has moved far."""
_ROUNDS = (12, 12)
"""Most steps with each blur."""
_ENOUGH = 0.04
"""[pixels] Size of a step after which no more are made."""
_SOME = 50
"""Points of which the greatest step is taken."""
_POINTS = 4000
"""Most points that are compared: those at which brightness changes most."""
_ALONG, _ACROSS = 1200, 40
"""Points along and across the keyboard of which they are chosen."""
_FEWEST = 300
"""Least number of points for a comparison."""
_OUTLIER = 3.0
"""Deviations, of normally distributed errors, from which on a point's weight is 0 (Tukey)."""
_MARGIN = 0.02
"""[m] What is seen so far behind and before the keys is of the piano too."""
_SLIPS = np.delete(np.arange(-6, 7), 6)
"""[white keys] Moves along the keyboard that look much like none, as keys look alike. A keyboard
does not move by an octave from one frame to the next, and looks the same then."""
_RATHER = 0.06
"""Correlation by which such a move must be better."""


@dataclass(frozen=True, eq=False)
class Registered:
    """Where a picture shows the keyboard of another one.

    Attributes:
        matrix: (3, 3) homography of pixels (column, row, 1), from the reference to the picture.
        likeness: correlation of the brightness of the points that are no outliers, with as many
            counted as outliers as there are; 1 at most.
        visible: share of the points of the reference that are in the picture.
    """

    matrix: NDArray[np.float64]
    likeness: float
    visible: float

    __repr__ = short_repr


class Pyramid:
    """A picture in grey at about half its size, with each blur.

    Attributes:
        factor: how many times smaller it is.
        levels: (height, width) brightness with each blur, from coarse to fine, 0..1.
    """

    def __init__(self, picture: NDArray[np.uint8]) -> None:
        """Shrink and blur a picture.

        Args:
            picture: (height, width, 3) or (height, width) uint8.
        """
        self.factor = max(1, round(max(picture.shape[:2]) / _WIDEST))
        image = Image.fromarray(picture).convert("L").reduce(self.factor)
        small = np.asarray(image, np.float32) / 255
        self.levels = [gaussian_filter(small, blur, truncate=3.0) for blur in _BLURS]


class Template:
    """A keyboard in one picture, which is looked for in others."""

    def __init__(self, pyramid: Pyramid, plane: Plane) -> None:
        """Choose the points that are compared.

        Args:
            pyramid: the picture.
            plane: plane of the keyboard in it, at its own size.
        """
        self._factor = pyramid.factor
        x, y = np.meshgrid(
            np.linspace(FAR - _MARGIN, FRONT + _MARGIN, _ACROSS),
            LEFT_EDGE + np.linspace(-1, len(WHITES) + 1, _ALONG) * WHITE_WIDTH,
            indexing="ij",
        )
        world = np.stack((x, y), axis=-1).reshape(-1, 2)
        places = plane.to_pixels(world) / self._factor
        height, width = pyramid.levels[0].shape
        inside = ((places > 1) & (places < [width - 1, height - 1])).all(axis=1)
        world, places = world[inside], places[inside]
        slopes = [_slopes(level, places) for level in pyramid.levels]
        strength = np.hypot(*slopes[-1].T)
        chosen = np.sort(np.argsort(-strength, kind="stable")[:_POINTS])
        self.points = places[chosen]
        self._slipped = [
            plane.to_pixels(world[chosen] + [0.0, keys * WHITE_WIDTH]) / self._factor
            for keys in _SLIPS
        ]
        middle = self.points.mean(axis=0) if len(chosen) else np.zeros(2)
        scale = max(1.0, float(np.abs(self.points - middle).max(initial=1.0)))
        self._norm = np.array(
            [[1 / scale, 0, -middle[0] / scale], [0, 1 / scale, -middle[1] / scale], [0, 0, 1.0]]
        )
        self._back = np.linalg.inv(self._norm)
        u, v = ((self.points - middle) / scale).T
        one, none = np.ones_like(u), np.zeros_like(u)
        # Movement of a point in pixels with the 8 numbers of a homography near the identity.
        du = scale * np.stack((u, v, one, none, none, none, -u * u, -u * v), axis=1)
        dv = scale * np.stack((none, none, none, u, v, one, -u * v, -v * v), axis=1)
        self._value = [_values(level, self.points) for level in pyramid.levels]
        self._steepest = [slope[chosen, :1] * du + slope[chosen, 1:] * dv for slope in slopes]

    def __len__(self) -> int:
        """Number of points that are compared."""
        return len(self.points)

    def find(self, pyramid: Pyramid, guess: NDArray[np.float64]) -> Registered | None:
        """Find the keyboard in a picture.

        Args:
            pyramid: the picture, of the same size.
            guess: (3, 3) about the homography of pixels from the reference to it.

        Returns:
            Where it is; None if too little of it is in the picture.
        """
        shrink = np.diag([1 / self._factor, 1 / self._factor, 1.0])
        found = self._register(pyramid, shrink @ guess @ np.linalg.inv(shrink))
        slip = None if found is None else self._slip(pyramid.levels[-1], found.matrix)
        if slip is not None:
            found = self._register(pyramid, slip)
            # Where none of them is clearly the best, it is not known where the keyboard is.
            if found is None or self._slip(pyramid.levels[-1], found.matrix) is not None:
                return None
        if found is None:
            return None
        matrix = np.linalg.inv(shrink) @ found.matrix @ shrink
        return Registered(matrix / matrix[2, 2], found.likeness, found.visible)

    def _slip(
        self, level: NDArray[np.float32], matrix: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """A homography, some keys along the keyboard, by which a picture is much more like it."""
        value, here = self._value[-1], _values(level, _moved(matrix, self.points))
        better = []
        for slipped in self._slipped:
            there = _values(level, _moved(matrix, slipped))
            both = np.isfinite(here) & np.isfinite(there)
            better.append(
                _correlation(value[both], there[both]) - _correlation(value[both], here[both])
            )
        best = int(np.argmax(better))
        if better[best] <= _RATHER:
            return None
        some = slice(None, None, max(1, len(self.points) // _SOME))
        slipped = fit_plane(self.points[some], self._slipped[best][some]).matrix
        return np.asarray(matrix @ slipped)

    def _register(self, pyramid: Pyramid, matrix: NDArray[np.float64]) -> Registered | None:
        """As `find`, in shrunk pixels, from a guess that is right to a part of a key."""
        likeness = visible = 0.0
        for level, value, steepest, rounds in zip(
            pyramid.levels, self._value, self._steepest, _ROUNDS, strict=True
        ):
            for _ in range(rounds):
                at = _moved(matrix, self.points)
                seen = _values(level, at)
                known = np.isfinite(seen)
                visible = float(known.mean()) if len(known) else 0.0
                if known.sum() < _FEWEST:
                    return None
                now, then, slope = seen[known], value[known], steepest[known]
                gain, bias, weight = _fitted(then, now)
                off = now - gain * then - bias
                weighted = weight[:, None] * slope
                step = np.linalg.lstsq(weighted.T @ slope, weighted.T @ off, rcond=None)[0] / max(
                    gain, 0.1
                )
                change = self._back @ (np.eye(3) + np.append(step, 0.0).reshape(3, 3)) @ self._norm
                matrix = matrix @ np.linalg.inv(change)
                matrix /= matrix[2, 2]
                likeness = _likeness(then, now, weight)
                some = self.points[:: max(1, len(self.points) // _SOME)]
                if np.abs(_moved(change, some) - some).max() < _ENOUGH:
                    break
        return Registered(matrix, likeness, visible)


def _correlation(then: NDArray[np.float64], now: NDArray[np.float64]) -> float:
    """Of the brightness of points in two pictures; 0 if they are few."""
    if len(then) < _FEWEST:
        return 0.0
    a, b = then - then.mean(), now - now.mean()
    return float(a @ b) / max(math.sqrt(float(a @ a) * float(b @ b)), 1e-9)


def _fitted(
    then: NDArray[np.float64], now: NDArray[np.float64]
) -> tuple[float, float, NDArray[np.float64]]:
    """Gain and bias of brightness, robustly, and (N,) the weight of each point."""
    gain, bias = 1.0, float(np.median(now - then))
    weight = np.ones_like(then)
    for _ in range(3):
        off = np.abs(now - gain * then - bias)
        spread = max(1.4826 * float(np.median(off)), 0.01)
        weight = np.maximum(1 - (off / (_OUTLIER * spread)) ** 2, 0.0) ** 2
        total = max(float(weight.sum()), 1e-9)
        mean_then, mean_now = (float((weight * each).sum()) / total for each in (then, now))
        varied = float((weight * (then - mean_then) ** 2).sum())
        together = float((weight * (then - mean_then) * (now - mean_now)).sum())
        gain = min(max(together / max(varied, 1e-9), 0.2), 5.0)
        bias = mean_now - gain * mean_then
    return gain, bias, weight


def _likeness(
    then: NDArray[np.float64], now: NDArray[np.float64], weight: NDArray[np.float64]
) -> float:
    """Correlation of points with a weight, times the square root of the share that has one."""
    total = float(weight.sum())
    if total < 1:
        return 0.0
    a = then - float((weight * then).sum()) / total
    b = now - float((weight * now).sum()) / total
    both = float((weight * a * b).sum())
    alone = float((weight * a * a).sum()) * float((weight * b * b).sum())
    share = float((weight > 0).mean())
    return both * math.sqrt(share / max(alone, 1e-12))


def _moved(matrix: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    lifted = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(lifted[:, :2] / lifted[:, 2:])


def _values(level: NDArray[np.float32], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) Brightness at points (N, 2); NaN outside the picture."""
    at = places.T[::-1] - 0.5
    return np.asarray(
        map_coordinates(level, at, order=1, mode="constant", cval=np.nan, output=np.float64)
    )


def _slopes(level: NDArray[np.float32], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 2) Change of brightness at points (N, 2) with column and row [1/pixel]."""
    right = _values(level, places + [1.0, 0]) - _values(level, places - [1.0, 0])
    down = _values(level, places + [0, 1.0]) - _values(level, places - [0, 1.0])
    return np.nan_to_num(np.stack((right, down), axis=1) / 2)
