"""How the residual of fingers is learned. Cheap to import: no numpy, no torch."""

from __future__ import annotations

from dataclasses import dataclass

from pianomime.errors import InputError
from pianomime.learn.runs.validation import above_zero, within


@dataclass(frozen=True)
class FingersConfig:
    """Proximal policy optimisation of ten fingers in many songs."""

    frames: int = 400_000
    """Frames that are played, in all worlds together; each has ten fingers."""
    worlds: int = 32
    """Songs played side by side."""
    frames_per_update: int = 2048
    """Frames between updates, in all worlds together."""
    batch: int = 2048
    """Fingers in a minibatch."""
    epochs: int = 4
    """Passes over the frames of an update."""
    learning_rate: float = 5e-4
    """At the start; it falls to 0 at the end."""
    hidden: tuple[int, ...] = (128, 128)
    """Width of each hidden layer, of the actor and of the critic."""
    discount: float = 0.8
    """Of rewards, from frame to frame: what a finger does is seen soon."""
    gae: float = 0.9
    """Lambda of the generalised advantage estimate."""
    noise: float = 0.3
    """Standard deviation of actions at the start."""
    effort: float = 0.02
    """Reward that a finger loses for its actions, all at their ends."""
    wrong: float = 1.0
    """Reward that it loses for a key that it presses and nobody wants; one that it should press
    and does has 1."""
    seconds: float = 30.0
    """Of each song, at most [s]."""
    seed: int = 0
    """Of everything that is drawn."""


def check_fingers(config: FingersConfig) -> None:
    """Refuse settings out of range.

    Raises:
        InputError: the first of them, as it is called on the command line.
    """
    for name in ("frames", "worlds", "frames_per_update", "epochs"):
        within(name, getattr(config, name), 1)
    within("batch", config.batch, 2)
    for name in ("learning_rate", "noise", "seconds"):
        above_zero(name, getattr(config, name))
    for name in ("discount", "gae"):
        within(name, getattr(config, name), 0, 1)
    for name in ("effort", "wrong", "seed"):
        within(name, getattr(config, name), 0)
    for width in config.hidden:
        within("hidden", width, 1)
    if config.frames_per_update % config.worlds:
        raise InputError(
            f"frames-per-update ({config.frames_per_update}) must be a multiple of worlds "
            f"({config.worlds})"
        )
