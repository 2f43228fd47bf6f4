"""Settings of the goal autoencoder's training. Cheap to import: no torch."""

from __future__ import annotations

from dataclasses import dataclass, field

from pianomime.keyboard import KEYS
from pianomime.learn.runs.trainer_config import TrainerConfig
from pianomime.validation import whole_numbers, within

RESULT = "goal.safetensors"
"""The file that a finished training leaves in its folder."""


@dataclass(frozen=True)
class GoalConfig:
    """Training of the goal autoencoder (paper, appendix E and algorithm 2)."""

    queries: int = 8
    """Points at which the distance to each sampled goal is learned."""
    octaves: int = 6
    """Frequencies of the positional encoding, each twice the one before."""
    transpose: int = 12
    """Augment the data: move goals by up to this many semitones, either way."""
    validation_share: float = 0.1
    """Share of the MIDI files that is kept for validation."""
    trainer: TrainerConfig = field(
        # In bfloat16, distances would have steps of some 5 mm.
        default_factory=lambda: TrainerConfig(steps=60_000, learning_rate=1e-3, bfloat16=False)
    )

    def __post_init__(self) -> None:
        whole_numbers(self)
        within("queries", self.queries, 1)
        within("octaves", self.octaves, 0, 12)
        within("transpose", self.transpose, 0, KEYS - 1)
        within("validation_share", self.validation_share, 0, 0.9)
