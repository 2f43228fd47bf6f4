"""How lessons are held. Cheap to import: no numpy, no torch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pianomime.learn.runs.validation import within


@dataclass(frozen=True)
class DaggerConfig:
    """How lessons are held."""

    noise: float = 0.2
    """[rad] Most that is added to the controls of fingers by chance; each lesson has a share of it
    of its own. Wrists and forearms get as much less as their moves carry fingers farther."""
    smooth: float = 0.8
    """Share of it that stays from one frame to the next."""
    pilot: Path | None = None
    """Low level (.onnx) whose controls are played; the teacher's if not given."""
    planner: Path | None = None
    """High level (.onnx) whose fingertips are shown; the human's if not given."""
    most: int = 0
    """Demonstrations, evenly taken from all; 0 for all."""
    seed: int = 0
    """Of what is drawn."""


def check_dagger(config: DaggerConfig) -> None:
    """Refuse settings out of range.

    Raises:
        InputError: the first of them, as it is called on the command line.
    """
    within("noise", config.noise, 0, 1)
    within("smooth", config.smooth, 0, 0.99)
    for name in ("most", "seed"):
        within(name, getattr(config, name), 0)
