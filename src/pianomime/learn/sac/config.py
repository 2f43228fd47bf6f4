"""How one policy learns all songs by trying. Cheap to import: no numpy, no torch."""

from __future__ import annotations

from dataclasses import dataclass

from pianomime.learn.runs.validation import above_zero, within


@dataclass(frozen=True)
class SacConfig:
    """Soft actor-critic on many songs (paper, appendix G, multi-task RL)."""

    frames: int = 500_000
    """Frames that are played, in all worlds together."""
    worlds: int = 32
    """Songs played side by side."""
    updates: int = 8
    """Gradient steps for each frame that all worlds have played."""
    batch: int = 256
    """Frames in a minibatch."""
    buffer: int = 200_000
    """Frames that are remembered."""
    learning_rate: float = 3e-4
    """Of actor, critics and temperature."""
    hidden: tuple[int, ...] = (256, 256, 256)
    """Width of each hidden layer, of the actor and of the critics."""
    discount: float = 0.9
    """Of rewards, from frame to frame."""
    seconds: float = 30.0
    """Of each song, at most [s]."""
    seed: int = 0
    """Of everything that is drawn."""

    @property
    def first(self) -> int:
        """Frames that are played by chance before anything is learned."""
        return 10 * self.batch


def check_sac(config: SacConfig) -> None:
    """Refuse settings out of range.

    Raises:
        InputError: the first of them, as it is called on the command line.
    """
    for name in ("frames", "worlds", "updates", "batch"):
        within(name, getattr(config, name), 1)
    within("buffer", config.buffer, config.batch)
    for name in ("learning_rate", "seconds"):
        above_zero(name, getattr(config, name))
    within("discount", config.discount, 0, 1)
    within("seed", config.seed, 0)
    for width in config.hidden:
        within("hidden", width, 1)
    # Before, actions are by chance, and nothing is learned.
    within("frames", config.frames, config.first + 1)
