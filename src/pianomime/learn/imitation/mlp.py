"""A feedforward network that says the mean of what humans do (paper, appendix G, BC-MSE)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

from pianomime.learn.imitation.config import MlpConfig
from pianomime.learn.imitation.shapes import Sizes


class MlpNet(nn.Module):
    """From all that is seen to one chunk.

    Args:
        sizes: of what is given and said.
        config: its own.
    """

    def __init__(self, sizes: Sizes, config: MlpConfig) -> None:
        super().__init__()
        widths = (sizes.frames * sizes.channels + sizes.vector, *config.hidden)
        self.layers = hidden_layers(widths)
        self.last = nn.Linear(widths[-1], sizes.chunk * sizes.width)
        self.shape = (sizes.chunk, sizes.width)

    def forward(self, ahead: Tensor, vector: Tensor) -> Tensor:
        """(B, T, D)."""
        seen = torch.cat([ahead.flatten(1), vector], dim=1)
        out: Tensor = self.last(self.layers(seen))
        return out.reshape(-1, *self.shape)

    def loss(self, ahead: Tensor, vector: Tensor, target: Tensor) -> Tensor:
        """Mean squared error."""
        said: Tensor = self(ahead, vector)
        return nn.functional.mse_loss(said.float(), target)


def hidden_layers(widths: Sequence[int]) -> nn.Sequential:
    """Layers from each width to the next."""
    layers: list[nn.Module] = []
    for before, after in pairwise(widths):
        layers += [nn.Linear(before, after), nn.LayerNorm(after), nn.GELU()]
    return nn.Sequential(*layers)
