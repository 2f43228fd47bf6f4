"""Chunks by diffusion: noise is added to what should be said, a network learns to take it off."""

from __future__ import annotations

from typing import Any

import torch
from diffusers.schedulers import DDPMScheduler
from torch import Tensor, nn

from pianomime.learn.imitation.config import DiffusionConfig
from pianomime.learn.imitation.mlp import hidden_layers
from pianomime.learn.imitation.shapes import Sizes
from pianomime.learn.imitation.unet import ConditionalUnet, TemporalEncoder


def noise_schedule(config: DiffusionConfig) -> Any:
    """How much noise there is at each step, a `DDPMScheduler`."""
    return DDPMScheduler(
        num_train_timesteps=config.steps,
        beta_schedule="squaredcos_cap_v2",
        prediction_type=config.prediction,
        clip_sample=True,
    )


class DiffusionNet(nn.Module):
    """A conditional U-Net and its noise.

    Args:
        sizes: of what is given and said.
        config: its own.
    """

    def __init__(self, sizes: Sizes, config: DiffusionConfig) -> None:
        super().__init__()
        self.encoder = TemporalEncoder(sizes.frames, sizes.channels, config)
        widths = (self.encoder.width + sizes.vector, *config.condition)
        self.together = hidden_layers(widths)
        self.unet = ConditionalUnet(sizes.chunk, sizes.width, widths[-1], config)
        self.guess = nn.Linear(widths[-1], sizes.chunk * sizes.width) if config.guess else None
        self.config, self.schedule = config, noise_schedule(config)

    def forward(self, ahead: Tensor, vector: Tensor, noisy: Tensor, step: Tensor) -> Tensor:
        """(B, T, D): the noise in chunks (B, T, D) at steps (B,), or what is without it."""
        seen = self.together(torch.cat([self.encoder(ahead), vector], dim=1))
        out: Tensor = self.unet(noisy, step, seen)
        return out if self.guess is None else out + self.guess(seen).reshape(noisy.shape)

    def loss(self, ahead: Tensor, vector: Tensor, target: Tensor) -> Tensor:
        """Mean squared error at steps by chance."""
        noise = torch.randn_like(target)
        step = torch.randint(0, self.config.steps, (len(target),), device=target.device)
        noisy = self.schedule.add_noise(target, noise, step)
        wanted = noise if self.config.prediction == "epsilon" else target
        return nn.functional.mse_loss(self(ahead, vector, noisy, step).float(), wanted)
