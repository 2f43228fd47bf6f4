"""How a network is trained. Cheap to import: no numpy, no torch."""

from __future__ import annotations

from dataclasses import dataclass

from pianomime.learn.runs.validation import above_zero, within


@dataclass(frozen=True)
class TrainerConfig:
    """Training by gradient descent (paper, appendix F and tables 7 and 8)."""

    steps: int
    """Updates, in all."""
    batch: int = 256
    """Samples in an update, on all GPUs together."""
    learning_rate: float = 1e-4
    """At its highest; it falls to 0 at the last step, along a cosine."""
    weight_decay: float = 1e-6
    """Of AdamW."""
    warmup: int = 500
    """Steps in which the learning rate rises from 0."""
    ema_power: float = 0.75
    """The result is an average of the weights, which forgets by 1 - (1 + step)^-power."""
    seed: int = 0
    """Of everything that is drawn; the same seed gives the same weights."""
    bfloat16: bool = True
    """Multiply in bfloat16, sum in float32, where the processor has instructions for that."""
    checkpoint_seconds: float = 60.0
    """Between checkpoints [s]."""
    evaluate_every: int = 0
    """Steps between evaluations; 0 for only one, at the end."""


FREE = ("checkpoint_seconds", "evaluate_every")
"""What may be another when a training goes on: it does not change the weights."""


def check_fit(config: TrainerConfig) -> None:
    """Refuse settings out of range.

    Raises:
        InputError: the first of them, as it is called on the command line.
    """
    for name in ("steps", "batch"):
        within(f"fit.{name}", getattr(config, name), 1)
    for name in ("learning_rate", "ema_power"):
        above_zero(f"fit.{name}", getattr(config, name))
    for name in ("weight_decay", "seed", "checkpoint_seconds", "evaluate_every"):
        within(f"fit.{name}", getattr(config, name), 0)
    within("fit.warmup", config.warmup, 0, config.steps - 1)
