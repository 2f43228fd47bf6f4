"""Statistics of pictures, of which one after the other is added."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pianomime.learn.export.feature_stats import QUANTILES

_COLOURS = 3
_LEVELS = 256
"""Of a colour of a pixel."""


class PictureStats:
    """Exact statistics of red, green and blue, as LeRobot has them of pictures.

    They are of every picture: it costs little beside rendering them.
    """

    def __init__(self) -> None:
        self._pixels = np.zeros((_COLOURS, _LEVELS), np.int64)
        self._count = 0

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Add a picture (height, width, 3) uint8."""
        for pixels, colour in zip(self._pixels, np.moveaxis(picture, -1, 0), strict=True):
            pixels += np.bincount(colour.ravel(), minlength=_LEVELS)
        self._count += 1

    def __iadd__(self, other: PictureStats) -> Self:
        """Add all pictures of another."""
        self._pixels += other._pixels
        self._count += other._count
        return self

    def of_all(self) -> dict[str, NDArray[Any]]:
        """Statistics of all pixels, of pictures of one size, of which there is at least one.

        Returns:
            `min`, `max`, `mean`, `std` and the quantiles, each (3, 1, 1), 0..1, and the `count` of
            pictures, (1,).
        """
        levels = np.linspace(0.0, 1.0, _LEVELS)
        every = []
        for pixels in self._pixels:
            there = levels[pixels > 0]
            mean = np.average(levels, weights=pixels)
            spread = np.average((levels - mean) ** 2, weights=pixels)
            quantiles = np.quantile(
                levels, list(QUANTILES.values()), weights=pixels, method="inverted_cdf"
            )
            every.append([there[0], there[-1], mean, np.sqrt(spread), *quantiles])
        names = ("min", "max", "mean", "std", *QUANTILES)
        stats = dict(zip(names, np.transpose(every)[..., None, None], strict=True))
        return {**stats, "count": np.array([self._count])}
