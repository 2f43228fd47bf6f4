"""Everything that decides how an expert is made: typed, saved with it, and the command line.

Every config checks itself when it is made and raises an `InputError` that names the setting as the
command line does, such as `ppo.batch-size`. Cheap to import: no numpy, no torch.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from pianomime.device_names import CPU
from pianomime.errors import InputError, unknown_name
from pianomime.learn.envs.config import ENV_PRESETS, EnvConfig
from pianomime.validation import above_zero, check_seed, one_of, whole_numbers, widths, within


@dataclass(frozen=True)
class PpoConfig:
    """Proximal policy optimisation (Schulman et al., 2017) with the settings of paper, table 6."""

    num_envs: int = 16
    """Number of environments that are stepped side by side."""
    steps_per_update: int = 8192
    """Control steps between updates, in all environments together."""
    batch_size: int = 1024
    """Control steps in a minibatch."""
    n_epochs: int = 10
    """Passes over the collected steps in each update."""
    learning_rate: float = 3e-4
    """Learning rate of the first update."""
    learning_rate_decay: float = 0.999
    """Factor on the learning rate from one update to the next."""
    hidden: tuple[int, ...] = (1024, 256)
    """Widths of the hidden layers, in the actor and in the critic."""
    activation: Literal["gelu", "relu", "tanh"] = "gelu"
    """Activation function between the layers."""
    gamma: float = 0.99
    """Discount factor of the rewards per control step."""
    gae_lambda: float = 0.95
    """Lambda of the generalised advantage estimate (Schulman et al., 2016)."""
    clip_range: float = 0.2
    """Clipping range of the likelihood ratio."""
    ent_coef: float = 0.0
    """Weight of the entropy bonus."""
    vf_coef: float = 0.5
    """Weight of the critic's loss."""
    max_grad_norm: float = 0.5
    """Gradients are clipped to this norm."""
    target_kl: float = 0.0
    """KL divergence at which the passes of an update end early; 0 for no limit."""
    initial_std: float = 0.3
    """Standard deviation of the actions at the start; table 6 does not give it."""
    evaluate_every: int = 1
    """Number of updates between evaluations."""

    def __post_init__(self) -> None:
        whole_numbers(self, "ppo")
        for name in ("n_epochs", "evaluate_every"):
            within(f"ppo.{name}", getattr(self, name), 1)
        within("ppo.num_envs", self.num_envs, 1, 10_000)
        for name in (
            "learning_rate",
            "learning_rate_decay",
            "clip_range",
            "max_grad_norm",
            "initial_std",
        ):
            above_zero(f"ppo.{name}", getattr(self, name))
        for name in ("gamma", "gae_lambda"):
            within(f"ppo.{name}", getattr(self, name), 0, 1)
        for name in ("ent_coef", "vf_coef", "target_kl"):
            within(f"ppo.{name}", getattr(self, name), 0)
        widths("ppo.hidden", self.hidden)
        one_of("ppo.activation", self.activation, ("gelu", "relu", "tanh"))
        steps = self.steps_per_update
        if steps < self.num_envs or steps % self.num_envs:
            raise InputError(
                f"ppo.steps-per-update ({steps}) must be a multiple of ppo.num-envs "
                f"({self.num_envs})"
            )
        if not 1 < self.batch_size <= steps:
            raise InputError(
                f"ppo.batch-size ({self.batch_size}) must be from 2 to ppo.steps-per-update "
                f"({steps})"
            )


@dataclass(frozen=True)
class TrajectorySearchConfig:
    """Trajectory search: pass after pass over the song, variations are tried in simulation."""

    variations: int = 32
    """Variations that are simulated side by side."""
    rounds: int = 2
    """Number of times that variations of the best so far are drawn at each instant."""
    commit: int = 4
    """Frames that are fixed before the search looks ahead again."""
    ahead: int = 12
    """Frames that are simulated ahead."""
    sizes: tuple[float, ...] = (1.0, 1.5, 0.5)
    """Sizes of the variations as factors of `PredictiveSamplingConfig`'s, one a pass, in turn."""

    def __post_init__(self) -> None:
        whole_numbers(self, "search")
        for name in ("variations", "rounds", "commit", "ahead"):
            within(f"search.{name}", getattr(self, name), 1)
        if not self.sizes:
            raise InputError("search.sizes must be one number or more")
        for size in self.sizes:
            above_zero("search.sizes", size)


@dataclass(frozen=True)
class ExpertConfig:
    """How an expert is made."""

    method: Literal["ppo", "search"] = "ppo"
    """Train a residual policy with PPO, or search for a trajectory of controls."""
    total_steps: int = 1_000_000
    """Control steps of simulation in all."""
    seed: int = 0
    """Seed of all random numbers; the same seed gives the same expert."""
    env: EnvConfig = field(default_factory=EnvConfig)
    ppo: PpoConfig = field(default_factory=PpoConfig)
    search: TrajectorySearchConfig = field(default_factory=TrajectorySearchConfig)

    def __post_init__(self) -> None:
        whole_numbers(self)
        one_of("method", self.method, ("ppo", "search"))
        within("total_steps", self.total_steps, 1)
        if self.method == "ppo":
            check_seed("seed", self.seed)
        within("seed", self.seed, 0)
        if self.method == "search" and self.env.device != CPU:
            # Its steps have to be those of the world in which it plays, bit for bit.
            raise InputError(f"env.device {self.env.device} needs method ppo: a search is on {CPU}")


_PAPER = ExpertConfig(env=ENV_PRESETS["paper"])
"""Appendices C and D. Table 6 has 2000 updates of 8192 steps; the default spends fewer."""

_BEST = ExpertConfig(method="search", env=ENV_PRESETS["best"])
"""What plays best in a quarter of an hour on two cores."""

PRESETS = {"paper": _PAPER, "best": _BEST}


def preset_config(name: str) -> ExpertConfig:
    """A config by its name.

    Raises:
        InputError: there is no such preset.
    """
    if name not in PRESETS:
        raise unknown_name("preset", name, PRESETS)
    return PRESETS[name]
