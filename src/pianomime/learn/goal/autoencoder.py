"""The networks of the goal autoencoder (paper, appendix E, figure 7).

The encoder is the paper's: four convolutions and a linear layer. The paper does not say how they
are normalized. The published code has batch normalization, and was used so that a code depended on
the other goals in its batch; here each goal is normalized by itself.
"""

from __future__ import annotations

import math
from typing import cast

import torch
from torch import Tensor, nn

from pianomime.keyboard import KEYS
from pianomime.learn.goal.sdf import QUERY_HIGH, QUERY_LOW

CODE = 16
"""Size of a code."""
FILTERS = (2, 4, 8, 16)
HIDDEN = 16
"""Width of the decoder's hidden layers."""


class GoalEncoder(nn.Module):
    """From goals to codes; 2152 parameters.

    Once `standardize` was called, each number of a code has mean 0 and variance 1 over the training
    goals.

    Attributes:
        mean, scale: (16,) mean and standard deviation of the last layer's output.
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
    def standardize(self, goal: Tensor) -> None:
        """Set `mean` and `scale` so that the codes of goals (N, 88) have mean 0 and variance 1."""
        self.mean.zero_()
        self.scale.fill_(1.0)
        scale, mean = torch.std_mean(self(goal), dim=0, correction=0)
        self.mean.copy_(mean)
        # A number that never varies stays as it is.
        self.scale.copy_(torch.where(scale > 1e-6, scale, 1.0))


class PositionalEncoding(nn.Module):
    """Positions, and sines and cosines of them at doubling frequencies.

    As in Mildenhall et al., "NeRF: representing scenes as neural radiance fields", 2020.

    Args:
        octaves: number of frequencies; the box of queries is half a period of the lowest.
    """

    low: Tensor
    high: Tensor
    frequencies: Tensor

    def __init__(self, octaves: int) -> None:
        super().__init__()
        self.size = 3 + 6 * octaves
        # Constants, which are not saved.
        for name, value in (
            ("low", torch.tensor(QUERY_LOW, dtype=torch.float32)),
            ("high", torch.tensor(QUERY_HIGH, dtype=torch.float32)),
            ("frequencies", math.pi / 2 * 2.0 ** torch.arange(octaves)),
        ):
            self.register_buffer(name, value, persistent=False)

    def forward(self, query: Tensor) -> Tensor:
        """(..., size) of positions (..., 3) in the world frame [m]."""
        # -1 to 1 in the box.
        place = 2.0 * (query - self.low) / (self.high - self.low) - 1.0
        angle = (place[..., None] * self.frequencies).flatten(-2)
        return torch.cat((place, angle.sin(), angle.cos()), dim=-1)


class GoalDecoder(nn.Module):
    """From a code and a position to the distance of the position to the goal.

    Args:
        octaves: frequencies of the positional encoding.
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
        """(...) distances of positions to goals, in lengths of the keyboard.

        Args:
            plain: (..., 16) output of the encoder's last layer: codes that are not standardized.
            query: (..., 3) positions in the world frame [m].
        """
        distances = self.layers(torch.cat((plain, self.encoding(query)), dim=-1))
        return cast(Tensor, distances[..., 0])


class GoalAutoencoder(nn.Module):
    """An encoder and the decoder with which it is trained.

    Args:
        octaves: frequencies of the positional encoding.
    """

    def __init__(self, octaves: int) -> None:
        super().__init__()
        self.encoder = GoalEncoder()
        self.decoder = GoalDecoder(octaves)

    def decode(self, code: Tensor, query: Tensor) -> Tensor:
        """(...) distances, in keyboard lengths, of (..., 3) [m] to goals with codes (..., 16)."""
        plain = code * self.encoder.scale + self.encoder.mean
        return cast(Tensor, self.decoder(plain, query))

    def forward(self, goal: Tensor, query: Tensor) -> Tensor:
        """(N, Q) distances, in keyboard lengths, of (N, Q, 3) [m] to goals (N, 88)."""
        code = self.encoder(goal)[:, None].expand(-1, query.shape[1], -1)
        return self.decode(code, query)
