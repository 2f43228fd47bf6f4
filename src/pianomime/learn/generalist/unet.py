"""A one-dimensional U-Net over the frames of a chunk, conditioned by FiLM (paper, appendix F)."""

from __future__ import annotations

import math
from itertools import pairwise

import torch
from torch import Tensor, nn

from pianomime.learn.generalist.config import DiffusionConfig

_GROUPS = 8


class TemporalEncoder(nn.Module):
    """Convolutions over the frames ahead: (B, T, C) to one row (B, width).

    Attributes:
        width: of the row.
    """

    def __init__(self, frames: int, channels: int, config: DiffusionConfig) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for before, after in pairwise((channels, *config.encoder)):
            layers.append(_convolution(before, after, config.encoder_kernel))
        self.layers = nn.Sequential(*layers)
        self.width = frames * config.encoder[-1]

    def forward(self, frames: Tensor) -> Tensor:
        """Of each sample."""
        features: Tensor = self.layers(frames.transpose(1, 2))
        return features.flatten(1)


class ConditionalUnet(nn.Module):
    """Says what noise is in chunks (B, T, D), or what they are without it.

    Args:
        width: D.
        condition: numbers that tell what is seen.
        config: sizes.
    """

    def __init__(self, width: int, condition: int, config: DiffusionConfig) -> None:
        super().__init__()
        told = config.step_width
        self.step = nn.Sequential(
            _StepEncoding(told), nn.Linear(told, 4 * told), nn.Mish(), nn.Linear(4 * told, told)
        )
        film, kernel = condition + told, config.kernel
        levels = [width, *config.channels]
        top = config.channels[-1]
        self.down = nn.ModuleList()
        for number, (before, after) in enumerate(pairwise(levels)):
            last = number == len(config.channels) - 1
            smaller = nn.Identity() if last else nn.Conv1d(after, after, 3, 2, 1)
            self.down.append(_Level(before, after, film, kernel, smaller))
        self.middle = nn.ModuleList([_Block(top, top, film, kernel) for _ in range(2)])
        self.up = nn.ModuleList()
        for before, after in pairwise(reversed(config.channels)):
            larger = nn.ConvTranspose1d(after, after, 4, 2, 1)
            self.up.append(_Level(2 * before, after, film, kernel, larger))
        first = config.channels[0]
        self.last = nn.Sequential(_convolution(first, first, kernel), nn.Conv1d(first, width, 1))

    def forward(self, noisy: Tensor, step: Tensor, condition: Tensor) -> Tensor:
        """(B, T, D) of noisy chunks (B, T, D) at steps (B,), seeing (B, condition)."""
        told = torch.cat([condition, self.step(step)], dim=1)
        x = noisy.transpose(1, 2)
        kept = []
        for level in self.down:
            x, resized = level(x, told)
            kept.append(x)
            x = resized
        for block in self.middle:
            x = block(x, told)
        for level in self.up:
            _, x = level(torch.cat([x, kept.pop()], dim=1), told)
        out: Tensor = self.last(x)
        return out.transpose(1, 2)


class _Level(nn.Module):
    """Two blocks, and what makes twice or half as many frames of theirs."""

    def __init__(self, before: int, after: int, told: int, kernel: int, resize: nn.Module) -> None:
        super().__init__()
        self.first = _Block(before, after, told, kernel)
        self.second = _Block(after, after, told, kernel)
        self.resize = resize

    def forward(self, x: Tensor, told: Tensor) -> tuple[Tensor, Tensor]:
        x = self.second(self.first(x, told), told)
        return x, self.resize(x)


class _Block(nn.Module):
    """Two convolutions with a way past them, the first scaled and moved by what is told."""

    def __init__(self, before: int, after: int, told: int, kernel: int) -> None:
        super().__init__()
        self.first = _convolution(before, after, kernel)
        self.second = _convolution(after, after, kernel)
        self.film = nn.Sequential(nn.Mish(), nn.Linear(told, 2 * after))
        self.past = nn.Conv1d(before, after, 1) if before != after else nn.Identity()

    def forward(self, x: Tensor, told: Tensor) -> Tensor:
        scale, move = self.film(told)[..., None].chunk(2, dim=1)
        out: Tensor = self.second((1 + scale) * self.first(x) + move) + self.past(x)
        return out


class _StepEncoding(nn.Module):
    """Sines and cosines of the step of the diffusion."""

    rates: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        rates = torch.exp(torch.arange(width // 2) * (-math.log(10_000) / (width // 2 - 1)))
        self.register_buffer("rates", rates, persistent=False)

    def forward(self, step: Tensor) -> Tensor:
        angle = step.to(torch.float32)[:, None] * self.rates
        return torch.cat([angle.sin(), angle.cos()], dim=1)


def _convolution(before: int, after: int, kernel: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv1d(before, after, kernel, padding=kernel // 2),
        nn.GroupNorm(_GROUPS, after),
        nn.Mish(),
    )
