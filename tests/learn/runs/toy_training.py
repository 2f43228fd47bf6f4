"""A network that learns a sine in a second, also in a process of its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from pianomime.learn.runs.trainer import Batch, train_network
from pianomime.learn.runs.trainer_config import TrainerConfig

CONFIG = TrainerConfig(
    steps=300, batch=32, learning_rate=3e-2, warmup=20, bfloat16=False, checkpoint_seconds=0.0
)


def network(wide: int = 16) -> nn.Module:
    torch.manual_seed(7)
    return nn.Sequential(nn.Linear(1, wide), nn.Tanh(), nn.Linear(wide, wide), nn.Tanh()).append(
        nn.Linear(wide, 1)
    )


def sample_batch(rng: np.random.Generator, batch: int) -> dict[str, np.ndarray]:
    x = rng.uniform(-1, 1, (batch, 1)).astype(np.float32)
    return {"x": x, "y": np.sin(3 * x)}


def loss(module: nn.Module, batch: Batch) -> Tensor:
    # Noise, so that what torch draws matters.
    x = batch["x"] + 0.01 * torch.randn_like(batch["x"])
    return ((module(x) - batch["y"]) ** 2).mean()


@torch.no_grad()
def error(module: nn.Module) -> dict[str, float]:
    x = torch.linspace(-1, 1, 101)[:, None]
    return {"error": float((module(x) - torch.sin(3 * x)).abs().mean())}


def train(
    folder: Path, config: TrainerConfig = CONFIG, wide: int = 16, **change: Callable[..., Any] | Any
) -> nn.Module:
    module = network(wide)
    settings = {"loss": loss, "sample_batch": sample_batch, "config": config, **change}
    train_network(folder, module, **settings)
    return module


def stop_at(step: int, how: BaseException) -> Callable[[nn.Module, Batch], Tensor]:
    """A loss that ends the training in an update, counted from 1."""
    calls = 0

    def stopping(module: nn.Module, batch: Batch) -> Tensor:
        nonlocal calls
        calls += 1
        if calls == step:
            raise how
        return loss(module, batch)

    return stopping


def long_run(folder: str, steps: int) -> None:
    """What a test kills."""
    train(Path(folder), dataclasses.replace(CONFIG, steps=steps))
