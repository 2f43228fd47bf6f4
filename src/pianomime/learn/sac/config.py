"""Settings of multi-task SAC. Cheap to import: no torch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.validation import above_zero, check_seed, one_of, whole_numbers, widths, within

Algorithm = Literal["sac", "tqc"]


@dataclass(frozen=True)
class SacConfig:
    """Soft actor-critic (Haarnoja et al., 2018) on many songs (paper, appendix G)."""

    algorithm: Algorithm = "sac"
    """The paper's, or truncated quantile critics (Kuznetsov et al., 2020), which go on from it."""
    total_steps: int = 500_000
    """Control steps in all environments together."""
    num_envs: int = 32
    """Number of songs that are played side by side."""
    gradient_steps: int = 8
    """Updates for each control step of all environments."""
    batch_size: int = 256
    """Transitions in a minibatch."""
    buffer_size: int = 200_000
    """Transitions that the replay buffer holds."""
    learning_rate: float = 3e-4
    """Learning rate of actor, critics and temperature."""
    hidden: tuple[int, ...] = (256, 256, 256)
    """Widths of the hidden layers, in the actor and in the critics."""
    gamma: float = 0.9
    """Discount factor of the rewards per control step."""
    hit: float = 0.5
    """Share of the reward that is given for goal keys; the rest is for no wrong key (paper, table
    3)."""
    reach: float = 0.0
    """Weight of a term that the paper does not have: how near to each goal key a fingertip is."""
    seconds: float = EXCERPT_SECONDS
    """Longest excerpt of each song [s]."""
    seed: int = 0
    """Seed of all random numbers."""

    def __post_init__(self) -> None:
        whole_numbers(self)
        for name in ("total_steps", "num_envs", "gradient_steps", "batch_size"):
            within(name, getattr(self, name), 1)
        within("buffer_size", self.buffer_size, self.batch_size)
        for name in ("learning_rate", "seconds"):
            above_zero(name, getattr(self, name))
        one_of("algorithm", self.algorithm, get_args(Algorithm))
        for name in ("gamma", "hit"):
            within(name, getattr(self, name), 0, 1)
        within("reach", self.reach, 0)
        check_seed("seed", self.seed)
        widths("hidden", self.hidden)
        within("total_steps", self.total_steps, self.learning_starts + 1)

    @property
    def learning_starts(self) -> int:
        """Control steps with random actions before the first update."""
        return 10 * self.batch_size
