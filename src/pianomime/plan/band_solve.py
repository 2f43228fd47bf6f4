"""Banded positive definite systems of any length, solved in windows of columns.

The Cholesky factor of an hour of music would take a gigabyte. Here it is in memory for one window
of columns at a time, and made again on the way back. LAPACK factors a matrix of few bands column by
column, and what a window leaves to the next is handed over in the same order of operations: the
solution is that of `scipy.linalg.solveh_banded` bit for bit (see
tests/plan/test_band_solve.py).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dsyr, dtbsv
from scipy.linalg.lapack import dpbtrf


def solve_in_windows(
    columns: Callable[[int, int], NDArray[np.float64]],
    right: NDArray[np.float64],
    bands: int,
    window: int,
) -> NDArray[np.float64]:
    """Solve A x = b for a symmetric positive definite A with few bands.

    Args:
        columns: gives the columns from a first to before a stop as a new array
            (stop - first, bands + 1): the diagonal, then what stands below it. It is called up to
            twice for each window, and must give the same each time.
        right: (n,) b.
        bands: number of bands below the diagonal; at most 64, beyond which LAPACK goes another way.
        window: columns that are in memory at once; at least `bands`.

    Returns:
        (n,) x.

    Raises:
        numpy.linalg.LinAlgError: A is not positive definite.
        ValueError: `window` is smaller than `bands`.
    """
    if window < bands:
        raise ValueError(f"a window of {window} columns is smaller than the {bands} bands")
    size = len(right)
    edges = [*range(0, size, window), size]
    solution = right.copy()
    carries = [np.zeros((0, 0))]
    factor = np.empty((0, bands + 1))
    for first, stop in pairwise(edges):
        beyond = min(stop + bands, size)
        band = columns(first, beyond)
        after = _lower_triangle(band[stop - first :])
        factor = _factor(band, carries[-1], stop - first)
        carries.append(_handed_over(factor[: stop - first], after))
        solution[first:beyond] = _substitute(factor, solution[first:beyond], back=False)
    for index in reversed(range(len(edges) - 1)):
        first, stop = edges[index], edges[index + 1]
        beyond = min(stop + bands, size)
        if stop < size:  # the factor of the last window is still there
            factor = _factor(columns(first, beyond), carries[index], stop - first)
        solution[first:beyond] = _substitute(factor, solution[first:beyond], back=True)
    return solution


def _factor(
    band: NDArray[np.float64], carry: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Columns of the Cholesky factor: `count` of them, and then those of the identity.

    Args:
        band: columns of A, as many as `count` reaches; overwritten.
        carry: lower triangle of the first of them, as the columns before leave it; may be empty.
        count: columns to factor.
    """
    for column in range(len(carry)):
        band[column, : len(carry) - column] = carry[column:, column]
    factor, info = dpbtrf(band.T, lower=1, overwrite_ab=1)
    if info:
        raise np.linalg.LinAlgError(f"not positive definite at column {info} of a window")
    made: NDArray[np.float64] = factor.T
    # What lies beyond has not all been taken from yet. As the identity it changes no bit of a
    # substitution.
    made[count:] = 0.0
    made[count:, 0] = 1.0
    return made


def _handed_over(factor: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the columns (n, bands + 1) of a factor leave of the lower triangle (m, m) after them."""
    left = np.asfortranarray(after)
    bands = factor.shape[1] - 1
    for back in range(min(bands, len(factor)), 0, -1):
        below = np.ascontiguousarray(factor[-back, back : back + len(left)])
        count = len(below)
        if count:
            left[:count, :count] = dsyr(-1.0, below, lower=1, a=left[:count, :count])
    return left


def _lower_triangle(band: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, m) lower triangle of the first m columns (m, bands + 1) of a band."""
    triangle = np.zeros((len(band), len(band)))
    for column in range(len(band)):
        triangle[column:, column] = band[column, : len(band) - column]
    return triangle


def _substitute(
    factor: NDArray[np.float64], right: NDArray[np.float64], back: bool
) -> NDArray[np.float64]:
    """Solve L x = b, or its transpose."""
    solved: NDArray[np.float64] = dtbsv(
        factor.shape[1] - 1, factor.T, right, lower=1, trans=int(back)
    )
    return solved
