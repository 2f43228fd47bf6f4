"""Normalizers of observations and actions; their parameters are saved with the weights."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

_MIN_SPREAD = 1e-4
"""Features that vary less than this in the data are not scaled up."""
_CLIP = 8.0
"""Observations are clipped to this many standard deviations. Some features hardly ever change: a
key that is seldom down would be hundreds of deviations away when it is."""
_TAIL = 0.0005
"""Share of the actions, at either end, that are clipped."""


class StandardNormalizer(nn.Module):
    """Observations with mean 0 and standard deviation 1, clipped to 8 standard deviations.

    Attributes:
        mean, std: (D,) of the data; part of the weights.

    Args:
        size: D.
    """

    mean: Tensor
    std: Tensor

    def __init__(self, size: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("std", torch.ones(size))

    def fit(self, values: NDArray[np.floating[Any]]) -> None:
        """Set mean and standard deviation to those of values (..., D)."""
        if not values.shape[-1]:
            return
        flat = values.reshape(-1, values.shape[-1]).astype(np.float64)
        std = flat.std(axis=0)
        self.mean.copy_(torch.from_numpy(flat.mean(axis=0)))
        self.std.copy_(torch.from_numpy(np.where(std < _MIN_SPREAD, 1.0, std)))

    def forward(self, values: Tensor) -> Tensor:
        """Normalize values (..., D)."""
        return ((values - self.mean) / self.std).clamp(-_CLIP, _CLIP)


class AsinhNormalizer(nn.Module):
    """Actions within -1..1 by asinh scaling: linear near the median, logarithmic in the tails.

    Hands mostly move by millimetres, and now and then leap by a hand's width. If the leaps set a
    linear scale, the millimetres would be lost in the noise of a diffusion. The area hyperbolic
    sine is the usual remedy for heavy tails of both signs (Burbidge, Magee and Robb, "Alternative
    transformations to handle extreme values of the dependent variable", 1988).

    Attributes:
        median: (D,) what becomes 0; part of the weights, as are the others.
        unit: (D,) distance from the median up to which it is about linear: the upper quartile of
            the distances in the data.
        limit: (D,) asinh((action - median) / unit) that becomes 1.

    Args:
        size: D.
    """

    median: Tensor
    unit: Tensor
    limit: Tensor

    def __init__(self, size: int) -> None:
        super().__init__()
        for name in ("median", "unit", "limit"):
            self.register_buffer(name, torch.ones(size))

    def fit(self, values: NDArray[np.floating[Any]]) -> None:
        """Set the parameters for values (..., D)."""
        flat = values.reshape(-1, values.shape[-1]).astype(np.float64)
        median = np.median(flat, axis=0)
        distance = np.abs(flat - median)
        unit = np.maximum(np.quantile(distance, 0.75, axis=0), _MIN_SPREAD)
        largest = np.quantile(distance, 1.0 - _TAIL, axis=0)
        self.median.copy_(torch.from_numpy(median))
        self.unit.copy_(torch.from_numpy(unit))
        self.limit.copy_(torch.from_numpy(np.arcsinh(np.maximum(largest, unit) / unit)))

    def forward(self, values: Tensor) -> Tensor:
        """Normalize values (..., D); those beyond the limit are clipped."""
        normalized: Tensor = torch.asinh((values - self.median) / self.unit) / self.limit
        return normalized.clamp(-1.0, 1.0)

    def denormalize(self, normalized: Tensor) -> Tensor:
        """Values (..., D) of normalized ones (..., D)."""
        x = normalized * self.limit
        # The hyperbolic sine, in operations that ONNX export knows.
        return (x.exp() - (-x).exp()) / 2 * self.unit + self.median
