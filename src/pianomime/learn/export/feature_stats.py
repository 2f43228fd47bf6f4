"""Statistics of features: of the numbers of one episode, and of all episodes while they go by."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
"""The quantiles that LeRobot stores, by its names for them."""
_SAMPLED_ROWS = 20_000
"""Rows at most of which the quantiles of all episodes are taken: enough for a hundredth of them at
either end, and few enough for memory."""


def episode_stats(values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Statistics of one feature in one episode.

    Args:
        values: (T, n).

    Returns:
        `min`, `max`, `mean`, `std` and the quantiles, each (n,), and the `count` of rows, (1,).
    """
    exact = values.astype(np.float64)
    return {
        "min": exact.min(axis=0),
        "max": exact.max(axis=0),
        "mean": exact.mean(axis=0),
        "std": exact.std(axis=0),
        "count": np.array([len(exact)]),
        **_quantiles(exact),
    }


class RunningStats:
    """Statistics of all episodes, to which one after the other is added.

    All are exact but the quantiles of long data sets, which are those of rows at equal distances.

    Args:
        total: rows of all episodes together.
    """

    def __init__(self, total: int) -> None:
        self._stride = -(-total // _SAMPLED_ROWS)
        self._stats: dict[str, dict[str, NDArray[Any]]] = {}
        self._sampled: dict[str, list[NDArray[Any]]] = {}
        self._rows = 0

    def add(
        self, features: dict[str, NDArray[Any]], stats: dict[str, dict[str, NDArray[Any]]]
    ) -> None:
        """Add an episode.

        Args:
            features: (T, n) of each name.
            stats: `episode_stats` of each.
        """
        first = -self._rows % self._stride
        for name, values in features.items():
            self._sampled.setdefault(name, []).append(values[first :: self._stride])
            before = self._stats.get(name)
            self._stats[name] = stats[name] if before is None else _merged(before, stats[name])
        self._rows += len(next(iter(features.values())))

    def of_all(self) -> dict[str, dict[str, NDArray[Any]]]:
        """Statistics of each feature, as `episode_stats` gives them."""
        return {
            name: {**stats, **_quantiles(np.concatenate(self._sampled[name]).astype(np.float64))}
            for name, stats in self._stats.items()
        }


def _quantiles(values: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    return dict(zip(QUANTILES, np.quantile(values, list(QUANTILES.values()), axis=0), strict=True))


def _merged(one: dict[str, NDArray[Any]], two: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Statistics, but quantiles, of two sets of rows together."""
    count = one["count"] + two["count"]
    share = two["count"] / count
    apart = two["mean"] - one["mean"]
    spread = (
        one["std"] ** 2 * (1 - share) + two["std"] ** 2 * share + apart**2 * share * (1 - share)
    )
    return {
        "min": np.minimum(one["min"], two["min"]),
        "max": np.maximum(one["max"], two["max"]),
        "mean": one["mean"] + apart * share,
        "std": np.sqrt(spread),
        "count": count,
    }
