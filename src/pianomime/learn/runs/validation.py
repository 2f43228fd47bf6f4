"""Refusing settings with which nothing can be learned, before anything is written."""

from __future__ import annotations

import math

from pianomime.errors import InputError
from pianomime.learn.expert.config import EnvConfig, ExpertConfig, PpoConfig, TrajectorySearchConfig


def check_config(config: ExpertConfig) -> None:
    """Refuse settings out of range, or that do not fit together.

    Raises:
        InputError: the first of them, as it is called on the command line.
    """
    within("steps", config.steps, 1)
    within("seed", config.seed, 0)
    check_env(config.env)
    if config.method == "ppo":
        _check_ppo(config.ppo)
    else:
        _check_search(config.search)


def check_env(config: EnvConfig) -> None:
    """As `check_config`, of the environment alone.

    Raises:
        InputError: the first of them, as it is called on the command line.
    """
    seen = config.observation
    within("env.observation.goal", seen.goal, 0)
    within("env.observation.fingertips", seen.fingertips, 0)
    if not any(vars(seen).values()):
        raise InputError("env.observation: a policy must see something")
    within("env.action.factor", config.action.factor, 0)
    for name, weight in vars(config.reward).items():
        within(f"env.reward.{name}", weight, 0)
    within("env.reward.hit", config.reward.hit, 0, 1)
    within("env.episode.frames", config.episode.frames, 0)


def _check_ppo(config: PpoConfig) -> None:
    for name in ("envs", "epochs", "evaluate_every"):
        within(f"ppo.{name}", getattr(config, name), 1)
    for name in ("learning_rate", "decay", "clip", "gradient_norm", "noise"):
        above_zero(f"ppo.{name}", getattr(config, name))
    for name in ("discount", "gae"):
        within(f"ppo.{name}", getattr(config, name), 0, 1)
    for name in ("entropy", "value", "target_kl"):
        within(f"ppo.{name}", getattr(config, name), 0)
    for width in config.hidden:
        within("ppo.hidden", width, 1)
    steps = config.steps_per_update
    if steps < config.envs or steps % config.envs:
        raise InputError(
            f"ppo.steps-per-update ({steps}) must be a multiple of ppo.envs ({config.envs})"
        )
    if not 1 < config.batch <= steps:
        raise InputError(
            f"ppo.batch ({config.batch}) must be from 2 to ppo.steps-per-update ({steps})"
        )


def _check_search(config: TrajectorySearchConfig) -> None:
    for name in ("variations", "rounds", "commit", "ahead"):
        within(f"search.{name}", getattr(config, name), 1)
    if not config.sizes:
        raise InputError("search.sizes must be one number or more")
    for size in config.sizes:
        above_zero("search.sizes", size)


def within(name: str, value: float, least: float, most: float = math.inf) -> None:
    """Refuse a number out of range, infinity and NaN among them.

    Raises:
        InputError: it is, told as it is called on the command line.
    """
    if not (least <= value <= most and math.isfinite(value)):
        wanted = f"{least:g} or more" if most == math.inf else f"{least:g} to {most:g}"
        raise InputError(f"{name.replace('_', '-')} must be {wanted}, not {value:g}")


def above_zero(name: str, value: float) -> None:
    """Refuse a number that is not more than 0, infinity and NaN among them.

    Raises:
        InputError: it is, told as it is called on the command line.
    """
    if not 0 < value < math.inf:
        raise InputError(f"{name.replace('_', '-')} must be more than 0, not {value:g}")
