"""A one-dimensional U-Net over the frames of a chunk, conditioned by FiLM (paper, appendix F).

The U-Net is that of Chi et al., "Diffusion policy", 2023; FiLM, feature-wise linear modulation, is
by Perez et al., "FiLM: visual reasoning with a general conditioning layer", 2018.

Chunks are so short that a convolution over their frames is computed as one matrix product, from all
frames to all: the same result, and faster on a CPU.
"""

from __future__ import annotations

import math
from itertools import pairwise

import torch
from torch import Tensor, nn

from pianomime.learn.imitation.config import GROUPS, DiffusionConfig


class TemporalEncoder(nn.Module):
    """Convolutions over the frames ahead, flattened to one row of features.

    Attributes:
        size: numbers in the row.

    Args:
        frames: G, frames ahead.
        channels: C, features of each.
        config: filters and kernel.
    """

    def __init__(self, frames: int, channels: int, config: DiffusionConfig) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for before, after in pairwise((channels, *config.encoder_channels)):
            layers.append(_convolution(before, after, config.encoder_kernel_size, frames))
        self.layers = nn.Sequential(*layers)
        self.size = frames * config.encoder_channels[-1]

    def forward(self, frames: Tensor) -> Tensor:
        """(B, size) of frames ahead (B, G, C)."""
        features: Tensor = self.layers(frames.transpose(1, 2))
        return features.flatten(1)


class ConditionalUnet(nn.Module):
    """Predicts the noise in chunks (B, T, D), or the chunks without it.

    Args:
        frames: T.
        width: D.
        condition: size of the encoded observation.
        config: sizes of the layers.
    """

    def __init__(self, frames: int, width: int, condition: int, config: DiffusionConfig) -> None:
        super().__init__()
        embedding = config.step_embedding
        self.step = nn.Sequential(
            _StepEncoding(embedding),
            nn.Linear(embedding, 4 * embedding),
            nn.Mish(),
            nn.Linear(4 * embedding, embedding),
        )
        film, kernel = condition + embedding, config.kernel_size
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
        """(B, T, D) of noisy chunks (B, T, D) at diffusion steps (B,), given (B, condition)."""
        encoded = nn.functional.mish(torch.cat([condition, self.step(step)], dim=1))
        x = noisy.transpose(1, 2)
        kept = []
        for level in self.down:
            x, resized = level(x, encoded)
            kept.append(x)
            x = resized
        for block in self.middle:
            x = block(x, encoded)
        for level in self.up:
            _, x = level(torch.cat([x, kept.pop()], dim=1), encoded)
        out: Tensor = self.last(x)
        return out.transpose(1, 2)


class FrameConvolution(nn.Module):
    """A convolution over few frames, (B, C, T) to (B, D, S), computed as one matrix product.

    Its weights are those of `nn.Conv1d` with half a kernel of padding; transposed, those of
    `nn.ConvTranspose1d` that doubles the number of frames.

    Args:
        before, after: C and D.
        kernel: frames of the kernel.
        frames: T.
        stride: of the convolution.
        transposed: whether it is a transposed convolution.
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
        # (kernel, T, S): 1 where that tap of the kernel leads from input frame to output frame.
        places = (tap == torch.arange(kernel)[:, None, None]).float()
        self.register_buffer("places", places, persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        """(B, D, S)."""
        whole = torch.einsum(self.sum, self.weight, self.places)
        out = x.flatten(1) @ whole.flatten(2).flatten(0, 1).to(x.dtype)
        return out.reshape(x.shape[0], -1, self.frames) + self.bias[:, None]


class _Level(nn.Module):
    """Two blocks, and a convolution that halves or doubles the number of frames."""

    def __init__(
        self, before: int, after: int, condition: int, kernel: int, frames: int, resize: nn.Module
    ) -> None:
        super().__init__()
        self.first = _Block(before, after, condition, kernel, frames)
        self.second = _Block(after, after, condition, kernel, frames)
        self.resize = resize

    def forward(self, x: Tensor, encoded: Tensor) -> tuple[Tensor, Tensor]:
        x = self.second(self.first(x, encoded), encoded)
        return x, self.resize(x)


class _Block(nn.Module):
    """A residual block of two convolutions, the first modulated by FiLM of the condition."""

    def __init__(self, before: int, after: int, condition: int, kernel: int, frames: int) -> None:
        super().__init__()
        self.first = _convolution(before, after, kernel, frames)
        self.second = _convolution(after, after, kernel, frames)
        self.film = nn.Linear(condition, 2 * after)
        self.shortcut = (
            FrameConvolution(before, after, 1, frames) if before != after else nn.Identity()
        )

    def forward(self, x: Tensor, encoded: Tensor) -> Tensor:
        gain, bias = self.film(encoded)[..., None].chunk(2, dim=1)
        out: Tensor = self.second((1 + gain) * self.first(x) + bias) + self.shortcut(x)
        return out


class _StepEncoding(nn.Module):
    """Sinusoidal embedding of the diffusion step (Vaswani et al., "Attention is all you need")."""

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
