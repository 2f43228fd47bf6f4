"""Running a diffusion backwards, in NumPy: DDIM, and DDPM as its noisy extreme.

Training uses the schedules of `diffusers`; this is the same arithmetic, so that playing needs no
torch (Song et al., "Denoising diffusion implicit models", equations 12 and 16).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Denoise = Callable[[NDArray[np.float32], NDArray[np.int64]], NDArray[np.float32]]
"""From noisy chunks (B, T, D) and their steps (B,) to what the network says of them."""


@dataclass(frozen=True)
class Sampler:
    """How a diffusion is run: the same weights allow all."""

    steps: int = 10
    """Calls of the network, as many as the diffusion has steps at most."""
    eta: float = 0.0
    """Noise that is added on the way: 0 is DDIM; 1 with all steps is DDPM, as in the paper."""


@cache
def signal(steps: int) -> NDArray[np.float64]:
    """(steps,) squared share of the signal that is left after each step, by a cosine; read-only."""

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
    draw: np.random.Generator,
) -> NDArray[np.float32]:
    """Chunks (B, T, D) within -1..1 of noise alone (B, T, D).

    Args:
        denoise: the network.
        noise: where to begin.
        steps: of the diffusion in training.
        prediction: what the network says: "epsilon", the noise, or "sample", what is without it.
        sampler: how.
        draw: of what is added on the way.
    """
    left = signal(steps)
    x = noise.astype(np.float64)
    number = min(sampler.steps, steps)
    times = np.round(steps - np.arange(number) * steps / number).astype(np.int64) - 1
    for now, after in zip(times, [*times[1:], -1], strict=True):
        said = denoise(x.astype(np.float32), np.full(len(x), now, np.int64))
        here, there = left[now], left[after] if after >= 0 else 1.0
        clean = said if prediction == "sample" else (x - math.sqrt(1 - here) * said) / here**0.5
        clean = np.clip(clean, -1.0, 1.0)
        direction = (x - math.sqrt(here) * clean) / math.sqrt(1 - here)
        spread = sampler.eta * math.sqrt((1 - there) / (1 - here) * (1 - here / there))
        x = math.sqrt(there) * clean + math.sqrt(max(1 - there - spread**2, 0.0)) * direction
        if spread:
            x = x + spread * draw.standard_normal(x.shape)
    return x.astype(np.float32)
