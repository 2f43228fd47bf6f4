"""Diffusion policy: a network learns to take noise off action chunks.

After Chi et al., "Diffusion policy: visuomotor policy learning via action diffusion", 2023, and
Ho, Jain and Abbeel, "Denoising diffusion probabilistic models", 2020. Sampling, when it plays, is
in `pianomime.policies.sampler`.
"""

from __future__ import annotations

from typing import Any

import torch
from diffusers.schedulers import DDPMScheduler
from torch import Tensor, nn

from pianomime.learn.imitation.config import DiffusionConfig
from pianomime.learn.imitation.mlp import hidden_layers
from pianomime.learn.imitation.shapes import NetworkShape
from pianomime.learn.imitation.unet import ConditionalUnet, TemporalEncoder


def noise_schedule(config: DiffusionConfig) -> Any:
    """The noise level of each diffusion step, as a `DDPMScheduler` with the squared cosine."""
    return DDPMScheduler(
        num_train_timesteps=config.steps,
        beta_schedule="squaredcos_cap_v2",
        prediction_type=config.prediction,
        clip_sample=True,
    )


class DiffusionNet(nn.Module):
    """A conditional U-Net and its noise schedule.

    Args:
        shape: of inputs and output.
        config: sizes of the layers, and the diffusion.
    """

    def __init__(self, shape: NetworkShape, config: DiffusionConfig) -> None:
        super().__init__()
        self.encoder = TemporalEncoder(shape.frames, shape.channels, config)
        widths = (self.encoder.size + shape.vector, *config.condition_layers)
        self.condition = hidden_layers(widths)
        self.unet = ConditionalUnet(shape.chunk, shape.action, widths[-1], config)
        self.skip = nn.Linear(widths[-1], shape.chunk * shape.action) if config.skip else None
        self.config, self.schedule = config, noise_schedule(config)

    def forward(self, ahead: Tensor, vector: Tensor, noisy: Tensor, step: Tensor) -> Tensor:
        """(B, T, D): the noise in chunks (B, T, D) at diffusion steps (B,), or the chunks without.

        Args:
            ahead: (B, G, C) frames ahead.
            vector: (B, V).
            noisy: (B, T, D) noisy chunks of normalized actions.
            step: (B,) diffusion step of each.
        """
        condition = self.condition(torch.cat([self.encoder(ahead), vector], dim=1))
        out: Tensor = self.unet(noisy, step, condition)
        return out if self.skip is None else out + self.skip(condition).reshape(noisy.shape)

    def loss(self, ahead: Tensor, vector: Tensor, target: Tensor) -> Tensor:
        """Mean squared error of the prediction, at random diffusion steps."""
        noise = torch.randn_like(target)
        step = torch.randint(0, self.config.steps, (len(target),), device=target.device)
        noisy = self.schedule.add_noise(target, noise, step)
        truth = noise if self.config.prediction == "epsilon" else target
        return nn.functional.mse_loss(self(ahead, vector, noisy, step).float(), truth)
