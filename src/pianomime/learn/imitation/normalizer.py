"""Bringing numbers to a common size: an explicit step, whose figures are saved with the weights."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

_FLAT = 1e-4
"""Numbers that vary less than this in the data are not scaled up."""
_FAR = 8.0
"""Deviations beyond which numbers that are seen are as if they were there. Some are nearly always
alike: a key that is seldom down would be hundreds of deviations away when it is."""
_TAIL = 0.0005
"""Share of the values of what is said, at either end, that its range leaves out."""


class Scale(nn.Module):
    """Mean 0 and deviation 1, within -8..8, for what is seen.

    Attributes:
        middle, spread: (D,) what becomes 0, and what lies 1 from it; a part of the weights.
    """

    middle: Tensor
    spread: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        self.register_buffer("middle", torch.zeros(width))
        self.register_buffer("spread", torch.ones(width))

    def fit(self, values: NDArray[np.floating[Any]]) -> None:
        """Take it from values (..., D)."""
        if not values.shape[-1]:
            return
        flat = values.reshape(-1, values.shape[-1]).astype(np.float64)
        spread = flat.std(axis=0)
        self.middle.copy_(torch.from_numpy(flat.mean(axis=0)))
        self.spread.copy_(torch.from_numpy(np.where(spread < _FLAT, 1.0, spread)))

    def forward(self, values: Tensor) -> Tensor:
        """Scaled."""
        return ((values - self.middle) / self.spread).clamp(-_FAR, _FAR)


class SaidScale(nn.Module):
    """Within -1..1, for what is said, and finest near what is usual.

    Hands mostly move by millimetres, and now and then leap by a hand's width. Were the leaps to
    set the scale, the millimetres would drown in the noise of a diffusion. So it is an area
    hyperbolic sine: even near the middle, logarithmic far from it.

    Attributes:
        middle, unit, limit: (D,) what becomes 0; how far from it things cease to be even; what
            becomes 1, in that scale. A part of the weights.
    """

    middle: Tensor
    unit: Tensor
    limit: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        for name in ("middle", "unit", "limit"):
            self.register_buffer(name, torch.ones(width))

    def fit(self, values: NDArray[np.floating[Any]]) -> None:
        """Take it from values (..., D)."""
        flat = values.reshape(-1, values.shape[-1]).astype(np.float64)
        middle = np.median(flat, axis=0)
        off = np.abs(flat - middle)
        unit = np.maximum(np.quantile(off, 0.75, axis=0), _FLAT)
        most = np.quantile(off, 1.0 - _TAIL, axis=0)
        self.middle.copy_(torch.from_numpy(middle))
        self.unit.copy_(torch.from_numpy(unit))
        self.limit.copy_(torch.from_numpy(np.arcsinh(np.maximum(most, unit) / unit)))

    def forward(self, values: Tensor) -> Tensor:
        """Scaled; what is beyond the range lies at its end."""
        scaled: Tensor = torch.asinh((values - self.middle) / self.unit) / self.limit
        return scaled.clamp(-1.0, 1.0)

    def undo(self, scaled: Tensor) -> Tensor:
        """What `forward` scaled."""
        off = scaled * self.limit
        # The hyperbolic sine, in operations that ONNX export knows.
        return (off.exp() - (-off).exp()) / 2 * self.unit + self.middle
