"""The networks of the goal autoencoder (paper, appendix E, figure 7).

The encoder is the paper's: four convolutions and a linear layer. It does not say how they are
normalised; the published code does it over the batch, and was used in a way that made a code depend
on what else was in the batch. Here each goal is normalised by itself, so there is no such thing.
"""

from __future__ import annotations

import math
from typing import cast

import torch
from torch import Tensor, nn

from pianomime.keyboard import KEYS
from pianomime.learn.goal.sdf import QUERY_HIGH, QUERY_LOW

CODE = 16
"""Numbers in a code."""
FILTERS = (2, 4, 8, 16)
HIDDEN = 16
"""Width of the decoder's layers."""


class GoalEncoder(nn.Module):
    """From goals to codes, 2152 weights.

    Each number of a code has mean 0 and variance 1 over the goals on which it was trained, once
    `standardise` was called.

    Attributes:
        mean, scale: (16,) by which what the last layer gives becomes a code.
    """

    mean: Tensor
    scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        before, length = 1, KEYS
        for filters in FILTERS:
            convolution = nn.Conv1d(before, filters, kernel_size=3, stride=2, padding=1)
            layers += [convolution, nn.GroupNorm(1, filters), nn.Mish()]
            before, length = filters, (length + 1) // 2
        self.layers = nn.Sequential(*layers, nn.Flatten(), nn.Linear(before * length, CODE))
        self.register_buffer("mean", torch.zeros(CODE))
        self.register_buffer("scale", torch.ones(CODE))

    def forward(self, goal: Tensor) -> Tensor:
        """(..., 16) codes of (..., 88) goals: 1.0 where a key should be down, else 0.0."""
        plain = self.layers(goal.reshape(-1, 1, KEYS))
        code: Tensor = (plain - self.mean) / self.scale
        return code.reshape(*goal.shape[:-1], CODE)

    @torch.no_grad()
    def standardise(self, goal: Tensor) -> None:
        """Choose `mean` and `scale` so that the codes of these (N, 88) goals have variance 1."""
        self.mean.zero_()
        self.scale.fill_(1.0)
        scale, mean = torch.std_mean(self(goal), dim=0, correction=0)
        self.mean.copy_(mean)
        # A number that is always the same stays so.
        self.scale.copy_(torch.where(scale > 1e-6, scale, 1.0))


class PositionalEncoding(nn.Module):
    """Points, and sines and cosines of them, each twice as quick as the one before.

    Args:
        octaves: how many frequencies; the slowest has its half period in the box of queries.
    """

    low: Tensor
    high: Tensor
    frequencies: Tensor

    def __init__(self, octaves: int) -> None:
        super().__init__()
        self.size = 3 + 6 * octaves
        # Constants: they are no part of what is saved.
        for name, value in (
            ("low", torch.tensor(QUERY_LOW, dtype=torch.float32)),
            ("high", torch.tensor(QUERY_HIGH, dtype=torch.float32)),
            ("frequencies", math.pi / 2 * 2.0 ** torch.arange(octaves)),
        ):
            self.register_buffer(name, value, persistent=False)

    def forward(self, query: Tensor) -> Tensor:
        """(..., size) of (..., 3) [m] world positions."""
        # -1 to 1 in the box.
        place = 2.0 * (query - self.low) / (self.high - self.low) - 1.0
        angle = (place[..., None] * self.frequencies).flatten(-2)
        return torch.cat((place, angle.sin(), angle.cos()), dim=-1)


class GoalDecoder(nn.Module):
    """From a code and a point to the distance of the point to the goal.

    Args:
        octaves: of the positional encoding.
    """

    def __init__(self, octaves: int) -> None:
        super().__init__()
        self.encoding = PositionalEncoding(octaves)
        self.layers = nn.Sequential(
            nn.Linear(CODE + self.encoding.size, HIDDEN),
            nn.Mish(),
            nn.Linear(HIDDEN, HIDDEN),
            nn.Mish(),
            nn.Linear(HIDDEN, 1),
        )

    def forward(self, plain: Tensor, query: Tensor) -> Tensor:
        """(...) distances in keyboards of (..., 3) [m] points to goals.

        Args:
            plain: (..., 16) what the encoder's last layer gave: codes that are not standardised.
            query: (..., 3) [m] world position.
        """
        distances = self.layers(torch.cat((plain, self.encoding(query)), dim=-1))
        return cast(Tensor, distances[..., 0])


class GoalAutoencoder(nn.Module):
    """An encoder and the decoder with which it was trained.

    Args:
        octaves: of the positional encoding.
    """

    def __init__(self, octaves: int) -> None:
        super().__init__()
        self.encoder = GoalEncoder()
        self.decoder = GoalDecoder(octaves)

    def decode(self, code: Tensor, query: Tensor) -> Tensor:
        """(...) distances in keyboards of (..., 3) [m] points to goals of (..., 16) codes."""
        plain = code * self.encoder.scale + self.encoder.mean
        return cast(Tensor, self.decoder(plain, query))

    def forward(self, goal: Tensor, query: Tensor) -> Tensor:
        """(N, Q) distances in keyboards of (N, Q, 3) [m] points to (N, 88) goals."""
        code = self.encoder(goal)[:, None].expand(-1, query.shape[1], -1)
        return self.decode(code, query)
