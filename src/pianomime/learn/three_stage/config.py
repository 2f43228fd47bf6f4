"""Settings of the three stages' training. Cheap to import: no numpy, no torch."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from pianomime.learn.runs.trainer_config import TrainerConfig
from pianomime.validation import whole_numbers, widths, within

StageName = Literal["fingering", "hand-motion", "hand-controls"]
STAGES: tuple[StageName, ...] = get_args(StageName)
"""The stages, in order: from goals to fingers, to fingertips, to controls."""


@dataclass(frozen=True)
class StageConfig:
    """One stage: a feedforward network that imitates."""

    hidden: tuple[int, ...] = (512, 512, 512)
    """Widths of the hidden layers."""
    dropout: float = 0.0
    """Share of the hidden numbers that are left out at random in training."""
    trainer: TrainerConfig = field(
        default_factory=lambda: TrainerConfig(
            steps=10_000, batch=512, learning_rate=1e-3, weight_decay=0.01
        )
    )

    def __post_init__(self) -> None:
        whole_numbers(self)
        widths("hidden", self.hidden)
        within("dropout", self.dropout, 0.0, 0.9)
