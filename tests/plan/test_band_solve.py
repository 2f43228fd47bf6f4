"""Banded systems in windows: the solution is LAPACK's, bit for bit, of few columns at a time."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from pianomime.plan.band_solve import solve_in_windows


def system(size: int, bands: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns (size, bands + 1) of a positive definite matrix, and a right side (size,)."""
    draw = np.random.default_rng(seed)
    columns = draw.standard_normal((size, bands + 1))
    columns[draw.random(columns.shape) < 0.3] = 0.0
    columns[:, 0] = 4 * bands + 1 + draw.random(size)
    return columns, draw.standard_normal(size)


@pytest.mark.parametrize("bands", [2, 7, 54])
@pytest.mark.parametrize("size", [2, 54, 540, 555, 2000])
@pytest.mark.parametrize("window", [54, 135, 540, 5000])
def test_windows_change_no_bit(size: int, bands: int, window: int) -> None:
    columns, right = system(size, bands, size + bands)
    whole = solveh_banded(columns.T, right, lower=True)
    asked = []

    def part(first: int, stop: int) -> NDArray[np.float64]:
        asked.append(stop - first)
        return columns[first:stop].copy()

    found = solve_in_windows(part, right, bands, window)
    np.testing.assert_array_equal(found, whole)
    assert max(asked) <= window + bands
    assert len(asked) <= 2 * -(-size // window) - 1


def test_a_matrix_that_is_not_positive_definite_is_refused() -> None:
    columns, right = system(300, 5, 0)
    columns[250, 0] = -1.0
    with pytest.raises(np.linalg.LinAlgError):
        solve_in_windows(lambda first, stop: columns[first:stop].copy(), right, 5, 100)


def test_windows_smaller_than_the_band_are_refused() -> None:
    with pytest.raises(ValueError, match="smaller than the 5 bands"):
        solve_in_windows(lambda first, stop: np.ones((stop - first, 6)), np.ones(9), 5, 4)
