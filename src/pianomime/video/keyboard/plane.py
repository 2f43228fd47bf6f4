"""The plane of the keyboard in a picture: a homography, and fits of one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.short_repr import short_repr

_TRIALS = 500
"""Random samples of four points in a robust fit."""


@dataclass(frozen=True, eq=False)
class Plane:
    """The plane of the keys' tops as a camera sees it.

    Attributes:
        matrix: (3, 3) homography, up to scale, from pixels (column, row, 1), measured from the
            outer corner of the top left pixel, to world (x, y, 1) [m].
    """

    matrix: NDArray[np.float64]

    __repr__ = short_repr

    def to_world(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """(..., 2) World x, y [m] of pixels (..., 2), column and row."""
        return _apply(self.matrix, np.asarray(pixels, np.float64))

    def to_pixels(self, world: ArrayLike) -> NDArray[np.float64]:
        """(..., 2) Column and row of world x, y (..., 2) [m]."""
        return _apply(
            np.asarray(np.linalg.inv(self.matrix), np.float64), np.asarray(world, np.float64)
        )

    def zoomed(self, factor: float) -> Plane:
        """The plane of the same picture at `factor` times its size."""
        return Plane(self.matrix @ np.diag([1 / factor, 1 / factor, 1.0]))


def _apply(matrix: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    lifted = points @ matrix[:, :2].T + matrix[:, 2]
    mapped: NDArray[np.float64] = lifted[..., :2] / lifted[..., 2:]
    return mapped


def fit_plane(pixels: ArrayLike, world: ArrayLike) -> Plane:
    """Fit a plane by the normalized direct linear transform (Hartley and Zisserman, section 4.4).

    Args:
        pixels: (N, 2) column, row of at least 4 points, no three of them in a line.
        world: (N, 2) x, y [m].

    Raises:
        ValueError: the points do not determine a plane.
    """
    seen, known = np.asarray(pixels, np.float64), np.asarray(world, np.float64)
    if len(seen) < 4:
        raise ValueError("at least 4 points are needed")
    shift_seen, shift_known = _normalizer(seen), _normalizer(known)
    u = _apply(shift_seen, seen)
    x = _apply(shift_known, known)
    one, none = np.ones((len(u), 1)), np.zeros((len(u), 3))
    lifted = np.hstack((u, one))
    rows = np.vstack(
        (
            np.hstack((lifted, none, -x[:, :1] * lifted)),
            np.hstack((none, lifted, -x[:, 1:] * lifted)),
        )
    )
    _, strength, basis = np.linalg.svd(rows)
    if strength[7] < 1e-9 * strength[0]:
        raise ValueError("the points lie on a line")
    matrix = np.linalg.inv(shift_known) @ basis[-1].reshape(3, 3) @ shift_seen
    return Plane(matrix / matrix[2, 2])


def fit_plane_robustly(
    pixels: ArrayLike, world: ArrayLike, tolerance: float = 0.008
) -> tuple[Plane, NDArray[np.bool_]]:
    """Fit a plane without points that do not agree with the others, by RANSAC.

    Args:
        pixels: (N, 2) column, row.
        world: (N, 2) x, y [m].
        tolerance: greatest error of a point that agrees [m].

    Returns:
        The plane, and (N,) bool, the points that agree with it.

    Raises:
        ValueError: the points do not determine a plane.
    """
    seen, known = np.asarray(pixels, np.float64), np.asarray(world, np.float64)
    plane = fit_plane(seen, known)
    good = _error(plane, seen, known) < tolerance
    if len(seen) > 4 and not good.all():
        rng = np.random.default_rng(0)
        for _ in range(_TRIALS):
            four = rng.choice(len(seen), 4, replace=False)
            try:
                candidate = fit_plane(seen[four], known[four])
            except (ValueError, np.linalg.LinAlgError):
                continue
            agrees = _error(candidate, seen, known) < tolerance
            if agrees.sum() > good.sum():
                good = agrees
    if good.sum() < 4:
        return plane, np.ones(len(seen), bool)
    return fit_plane(seen[good], known[good]), good


def _error(
    plane: Plane, seen: NDArray[np.float64], known: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N,) Distance of seen pixels from known world points [m]."""
    distance: NDArray[np.float64] = np.linalg.norm(plane.to_world(seen) - known, axis=1)
    # A plane fitted to three points in a line and one other maps some points to infinity.
    return np.where(np.isfinite(distance), distance, np.inf)


def _normalizer(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) Similarity that centres points, and scales their mean distance to sqrt(2)."""
    centre = points.mean(axis=0)
    spread = np.linalg.norm(points - centre, axis=1).mean()
    if spread == 0:
        raise ValueError("the points are all the same")
    scale = np.sqrt(2) / spread
    return np.array([[scale, 0, -scale * centre[0]], [0, scale, -scale * centre[1]], [0, 0, 1.0]])
