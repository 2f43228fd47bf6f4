"""Settings of the finger residual's training. Cheap to import: no torch."""

from __future__ import annotations

from dataclasses import dataclass

from pianomime.errors import InputError
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.validation import above_zero, check_seed, whole_numbers, widths, within

VALIDATION_SONGS = 8
"""Songs that are kept from training, on which the F1 is measured."""


@dataclass(frozen=True)
class FingersConfig:
    """Proximal policy optimisation (Schulman et al., 2017) of ten fingers, in many songs."""

    total_steps: int = 400_000
    """Control steps in all environments together; each has ten fingers."""
    num_envs: int = 32
    """Number of songs that are played side by side."""
    steps_per_update: int = 2048
    """Control steps between updates, in all environments together."""
    batch_size: int = 2048
    """Samples in a minibatch; each finger is one."""
    n_epochs: int = 4
    """Passes over the collected samples in each update."""
    learning_rate: float = 5e-4
    """Learning rate at the start; it falls linearly to 0."""
    hidden: tuple[int, ...] = (128, 128)
    """Widths of the hidden layers, in the actor and in the critic."""
    gamma: float = 0.8
    """Discount factor of the rewards per control step; a finger's actions have effect soon."""
    gae_lambda: float = 0.9
    """Lambda of the generalised advantage estimate (Schulman et al., 2016)."""
    action_std: float = 0.3
    """Standard deviation of the actions at the start."""
    action_cost: float = 0.02
    """Reward lost for actions that are all at their limits; quadratic in the action."""
    wrong_key_cost: float = 1.0
    """Reward lost for a pressed key that is not in the goal; an own key that is pressed earns 1."""
    seconds: float = EXCERPT_SECONDS
    """Longest excerpt of each song [s]."""
    seed: int = 0
    """Seed of all random numbers."""

    def __post_init__(self) -> None:
        whole_numbers(self)
        for name in ("total_steps", "steps_per_update", "n_epochs"):
            within(name, getattr(self, name), 1)
        within("num_envs", self.num_envs, 1, 10_000)
        within("batch_size", self.batch_size, 2)
        for name in ("learning_rate", "action_std", "seconds"):
            above_zero(name, getattr(self, name))
        for name in ("gamma", "gae_lambda"):
            within(name, getattr(self, name), 0, 1)
        for name in ("action_cost", "wrong_key_cost"):
            within(name, getattr(self, name), 0)
        check_seed("seed", self.seed)
        widths("hidden", self.hidden)
        if self.steps_per_update % self.num_envs:
            raise InputError(
                f"steps-per-update ({self.steps_per_update}) must be a multiple of num-envs "
                f"({self.num_envs})"
            )
