"""A feedforward network that says the mean of what humans do (paper, appendix G, BC-MSE)."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn

from pianomime.learn.generalist.config import MlpConfig
from pianomime.learn.generalist.sizes import Sizes


class MlpNet(nn.Module):
    """From all that is seen to one chunk.

    Args:
        sizes: of what is given and said.
        config: its own.
    """

    def __init__(self, sizes: Sizes, config: MlpConfig) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for before, after in pairwise(
            (sizes.frames * sizes.channels + sizes.vector, *config.hidden)
        ):
            layers += [nn.Linear(before, after), nn.LayerNorm(after), nn.GELU()]
        self.layers = nn.Sequential(
            *layers, nn.Linear(config.hidden[-1], sizes.chunk * sizes.width)
        )
        self.shape = (sizes.chunk, sizes.width)

    def forward(self, ahead: Tensor, vector: Tensor) -> Tensor:
        """(B, T, D)."""
        seen = torch.cat([ahead.flatten(1), vector], dim=1)
        out: Tensor = self.layers(seen)
        return out.reshape(-1, *self.shape)

    def loss(self, ahead: Tensor, vector: Tensor, target: Tensor) -> Tensor:
        """Mean squared error."""
        said: Tensor = self(ahead, vector)
        return nn.functional.mse_loss(said.float(), target)
