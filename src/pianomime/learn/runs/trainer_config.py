"""Settings of the supervised training loop. Cheap to import: no numpy, no torch."""

from __future__ import annotations

from dataclasses import dataclass

from pianomime.validation import above_zero, check_seed, whole_numbers, within

_LARGEST_BATCH = 65_536
"""Samples that no machine is short of memory for, and more than anybody wants."""


@dataclass(frozen=True)
class TrainerConfig:
    """Supervised training (paper, appendix F and tables 7 and 8)."""

    steps: int
    """Number of updates in all."""
    batch: int = 256
    """Number of samples in an update, on all GPUs together."""
    learning_rate: float = 1e-4
    """Greatest learning rate, reached after the warm-up; a cosine takes it to 0 at the end."""
    weight_decay: float = 1e-6
    """Weight decay of AdamW."""
    warmup: int = 500
    """Number of updates in which the learning rate rises linearly from 0; where it is not less than
    that of all updates, a tenth of these."""
    ema_power: float = 0.75
    """Power of the decay 1 - (1 + step)^-power of the weights' exponential moving average."""
    seed: int = 0
    """Seed of all random numbers; the same seed gives the same weights."""
    bfloat16: bool = True
    """Multiply in bfloat16 and sum in float32, where the processor has instructions for it."""
    checkpoint_seconds: float = 60.0
    """Time between checkpoints [s]."""
    evaluate_every: int = 0
    """Number of updates between evaluations; 0 for only one, at the end."""

    def __post_init__(self) -> None:
        whole_numbers(self, "trainer")
        within("trainer.steps", self.steps, 1)
        within("trainer.batch", self.batch, 1, _LARGEST_BATCH)
        for name in ("learning_rate", "ema_power"):
            above_zero(f"trainer.{name}", getattr(self, name))
        for name in ("weight_decay", "checkpoint_seconds", "evaluate_every"):
            within(f"trainer.{name}", getattr(self, name), 0)
        check_seed("trainer.seed", self.seed)
        within("trainer.warmup", self.warmup, 0)
        if self.warmup >= self.steps:
            # Whoever asks for a few updates to try it out does not think of this setting.
            object.__setattr__(self, "warmup", self.steps // 10)


MAY_DIFFER = ("checkpoint_seconds", "evaluate_every")
"""Settings that may be others when a run is resumed: they do not change the weights."""
