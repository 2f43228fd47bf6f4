"""A feedforward network that regresses the mean action (paper, appendix G, BC-MSE)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

from pianomime.learn.imitation.config import MlpConfig
from pianomime.learn.imitation.shapes import NetworkShape


class MlpNet(nn.Module):
    """From the whole observation, flattened, to one action chunk.

    Args:
        shape: of inputs and output.
        config: sizes of the layers.
    """

    def __init__(self, shape: NetworkShape, config: MlpConfig) -> None:
        super().__init__()
        widths = (shape.frames * shape.channels + shape.vector, *config.hidden)
        self.layers = hidden_layers(widths)
        self.last = nn.Linear(widths[-1], shape.chunk * shape.action)
        self.shape = (shape.chunk, shape.action)

    def forward(self, ahead: Tensor, vector: Tensor) -> Tensor:
        """(B, T, D) normalized actions of frames ahead (B, G, C) and vectors (B, V)."""
        features = torch.cat([ahead.flatten(1), vector], dim=1)
        out: Tensor = self.last(self.layers(features))
        return out.reshape(-1, *self.shape)

    def loss(self, ahead: Tensor, vector: Tensor, target: Tensor) -> Tensor:
        """Mean squared error to normalized actions (B, T, D)."""
        predicted: Tensor = self(ahead, vector)
        return nn.functional.mse_loss(predicted.float(), target)


def hidden_layers(widths: Sequence[int], dropout: float = 0.0) -> nn.Sequential:
    """Linear layers from each width to the next, each with layer normalization and GELU.

    Args:
        widths: of the input, and of each layer.
        dropout: share of the numbers after each that are left out at random in training.
    """
    layers: list[nn.Module] = []
    for before, after in pairwise(widths):
        layers += [nn.Linear(before, after), nn.LayerNorm(after), nn.GELU()]
        if dropout:
            layers.append(nn.Dropout(dropout))
    return nn.Sequential(*layers)
