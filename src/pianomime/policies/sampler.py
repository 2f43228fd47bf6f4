"""Sampling from a diffusion model, in NumPy: DDIM, and DDPM as its noisiest case.

Training uses the schedules of `diffusers`; this is the same arithmetic, so that playing needs no
torch (Song, Meng and Ermon, "Denoising diffusion implicit models", 2021, equations 12 and 16; Ho,
Jain and Abbeel, "Denoising diffusion probabilistic models", 2020).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from pianomime.validation import whole_numbers, within

Denoise = Callable[[NDArray[np.float32], NDArray[np.int64]], NDArray[np.float32]]
"""The network: from noisy chunks (B, T, D) and diffusion steps (B,) to predictions (B, T, D)."""


@dataclass(frozen=True)
class Sampler:
    """How a diffusion is sampled; one set of weights allows all."""

    steps: int = 10
    """Evaluations of the network; at most as many as the diffusion has steps."""
    eta: float = 0.0
    """Noise added on the way: 0 is DDIM; 1 with all steps is DDPM, as in the paper."""

    def __post_init__(self) -> None:
        whole_numbers(self)
        within("steps", self.steps, 1)
        within("eta", self.eta, 0, 1)


@cache
def alphas_cumprod(steps: int) -> NDArray[np.float64]:
    """(steps,) share of the signal's variance left after each step, alpha-bar; read-only.

    By the squared-cosine schedule (Nichol and Dhariwal, "Improved denoising diffusion probabilistic
    models", 2021, equation 17).
    """

    def level(time: float) -> float:
        return math.cos((time + 0.008) / 1.008 * math.pi / 2) ** 2

    beta = [min(1 - level((n + 1) / steps) / level(n / steps), 0.999) for n in range(steps)]
    left: NDArray[np.float64] = np.asarray(np.cumprod(1.0 - np.array(beta)))
    left.setflags(write=False)
    return left


def ddim_sample(
    denoise: Denoise,
    noise: NDArray[np.float32],
    steps: int,
    prediction: str,
    sampler: Sampler,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Chunks (B, T, D), within -1..1, from pure noise (B, T, D).

    Args:
        denoise: the network.
        noise: (B, T, D) standard normal.
        steps: of the diffusion in training.
        prediction: what the network outputs: "epsilon", the noise, or "sample", the chunk without.
        sampler: how to sample.
        rng: of the noise that is added on the way, if `sampler.eta` is above 0.
    """
    left = alphas_cumprod(steps)
    x = noise.astype(np.float64)
    number = min(sampler.steps, steps)
    times = np.round(steps - np.arange(number) * steps / number).astype(np.int64) - 1
    for now, after in zip(times, [*times[1:], -1], strict=True):
        output = denoise(x.astype(np.float32), np.full(len(x), now, np.int64))
        here, there = left[now], left[after] if after >= 0 else 1.0
        clean = output if prediction == "sample" else (x - math.sqrt(1 - here) * output) / here**0.5
        clean = np.clip(clean, -1.0, 1.0)
        direction = (x - math.sqrt(here) * clean) / math.sqrt(1 - here)
        spread = sampler.eta * math.sqrt((1 - there) / (1 - here) * (1 - here / there))
        x = math.sqrt(there) * clean + math.sqrt(max(1 - there - spread**2, 0.0)) * direction
        if spread:
            x = x + spread * rng.standard_normal(x.shape)
    return x.astype(np.float32)
