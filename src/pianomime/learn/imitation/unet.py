"""A one-dimensional U-Net over the frames of a chunk, conditioned by FiLM (paper, appendix F).

Chunks are so short that a convolution over their frames is done as one product of matrices, from
all frames to all: the same numbers, and faster on a processor.
"""

from __future__ import annotations

import math
from itertools import pairwise

import torch
from torch import Tensor, nn

from pianomime.learn.imitation.config import GROUPS, DiffusionConfig


class TemporalEncoder(nn.Module):
    """Convolutions over the frames ahead: (B, T, C) to one row (B, width).

    Attributes:
        width: of the row.
    """

    def __init__(self, frames: int, channels: int, config: DiffusionConfig) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for before, after in pairwise((channels, *config.encoder)):
            layers.append(_convolution(before, after, config.encoder_kernel, frames))
        self.layers = nn.Sequential(*layers)
        self.width = frames * config.encoder[-1]

    def forward(self, frames: Tensor) -> Tensor:
        """Of each sample."""
        features: Tensor = self.layers(frames.transpose(1, 2))
        return features.flatten(1)


class ConditionalUnet(nn.Module):
    """Says what noise is in chunks (B, T, D), or what they are without it.

    Args:
        frames: T.
        width: D.
        condition: numbers that tell what is seen.
        config: sizes.
    """

    def __init__(self, frames: int, width: int, condition: int, config: DiffusionConfig) -> None:
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
            smaller = nn.Identity() if last else FrameConvolution(after, after, 3, frames, stride=2)
            self.down.append(_Level(before, after, film, kernel, frames, smaller))
            frames = frames if last else (frames + 1) // 2
        self.middle = nn.ModuleList([_Block(top, top, film, kernel, frames) for _ in range(2)])
        self.up = nn.ModuleList()
        for before, after in pairwise(reversed(config.channels)):
            larger = FrameConvolution(after, after, 4, frames, stride=2, transposed=True)
            self.up.append(_Level(2 * before, after, film, kernel, frames, larger))
            frames *= 2
        first = config.channels[0]
        self.last = nn.Sequential(
            _convolution(first, first, kernel, frames), FrameConvolution(first, width, 1, frames)
        )

    def forward(self, noisy: Tensor, step: Tensor, condition: Tensor) -> Tensor:
        """(B, T, D) of noisy chunks (B, T, D) at steps (B,), seeing (B, condition)."""
        told = nn.functional.mish(torch.cat([condition, self.step(step)], dim=1))
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


class FrameConvolution(nn.Module):
    """A convolution over few frames, (B, C, T) to (B, D, S), as one product of matrices.

    Its weights are those of `nn.Conv1d` with half a kernel of padding; transposed, those of
    `nn.ConvTranspose1d` that doubles the number of frames.

    Args:
        before, after: C and D.
        kernel: frames of the kernel.
        frames: T.
        stride: frames from one place of the kernel to the next.
        transposed: whether it is the transpose of a convolution.
    """

    places: Tensor
    weight: Tensor
    bias: Tensor

    def __init__(
        self,
        before: int,
        after: int,
        kernel: int,
        frames: int,
        stride: int = 1,
        transposed: bool = False,
    ) -> None:
        super().__init__()
        padding = (kernel - 1) // 2
        convolution: nn.Conv1d | nn.ConvTranspose1d
        if transposed:
            convolution = nn.ConvTranspose1d(before, after, kernel, stride, padding)
            self.frames = stride * frames
            tap = torch.arange(self.frames) - stride * torch.arange(frames)[:, None] + padding
        else:
            convolution = nn.Conv1d(before, after, kernel, stride, padding)
            self.frames = (frames - 1) // stride + 1
            tap = torch.arange(frames)[:, None] - stride * torch.arange(self.frames) + padding
        assert convolution.bias is not None
        self.weight, self.bias = convolution.weight, convolution.bias
        self.sum = "iok,kts->itos" if transposed else "oik,kts->itos"
        # (kernel, T, S): 1 where that place of the kernel leads from one frame to the other.
        places = (tap == torch.arange(kernel)[:, None, None]).float()
        self.register_buffer("places", places, persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        """(B, D, S)."""
        whole = torch.einsum(self.sum, self.weight, self.places)
        out = x.flatten(1) @ whole.flatten(2).flatten(0, 1).to(x.dtype)
        return out.reshape(x.shape[0], -1, self.frames) + self.bias[:, None]


class _Level(nn.Module):
    """Two blocks, and what makes twice or half as many frames of theirs."""

    def __init__(
        self, before: int, after: int, told: int, kernel: int, frames: int, resize: nn.Module
    ) -> None:
        super().__init__()
        self.first = _Block(before, after, told, kernel, frames)
        self.second = _Block(after, after, told, kernel, frames)
        self.resize = resize

    def forward(self, x: Tensor, told: Tensor) -> tuple[Tensor, Tensor]:
        x = self.second(self.first(x, told), told)
        return x, self.resize(x)


class _Block(nn.Module):
    """Two convolutions with a way past them, the first scaled and moved by what is told."""

    def __init__(self, before: int, after: int, told: int, kernel: int, frames: int) -> None:
        super().__init__()
        self.first = _convolution(before, after, kernel, frames)
        self.second = _convolution(after, after, kernel, frames)
        self.film = nn.Linear(told, 2 * after)
        self.past = FrameConvolution(before, after, 1, frames) if before != after else nn.Identity()

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


def _convolution(before: int, after: int, kernel: int, frames: int) -> nn.Sequential:
    return nn.Sequential(
        FrameConvolution(before, after, kernel, frames),
        nn.GroupNorm(GROUPS, after),
        nn.Mish(),
    )
