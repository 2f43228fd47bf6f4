"""How the goal autoencoder is trained. Cheap to import: no numpy, no torch."""

from __future__ import annotations

from dataclasses import dataclass, field

from pianomime.learn.imitation.trainer_config import TrainerConfig, check_fit
from pianomime.learn.runs.validation import within


@dataclass(frozen=True)
class GoalConfig:
    """Training of the goal autoencoder (paper, appendix E and algorithm 2)."""

    queries: int = 8
    """Points of which the distance to a goal is learned, each time that the goal is drawn."""
    octaves: int = 6
    """Frequencies of the positional encoding, each twice the one before."""
    transpose: int = 12
    """Semitones by which a goal is moved at most, either way, when it is drawn."""
    unseen: float = 0.1
    """Share of the MIDI files that is kept for measuring."""
    fit: TrainerConfig = field(
        # In bfloat16, distances would be some 5 mm wide.
        default_factory=lambda: TrainerConfig(steps=60_000, learning_rate=1e-3, bfloat16=False)
    )


def check_goal(config: GoalConfig) -> None:
    """Refuse settings out of range.

    Raises:
        InputError: the first of them, as it is called on the command line.
    """
    within("queries", config.queries, 1)
    within("octaves", config.octaves, 0, 12)
    within("transpose", config.transpose, 0, 87)
    within("unseen", config.unseen, 0, 0.9)
    check_fit(config.fit)
