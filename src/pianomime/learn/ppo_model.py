"""Stable-Baselines3's PPO, and what it takes to go on with it where it was."""

from __future__ import annotations

import random
from abc import abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from pianomime.errors import InputError
from pianomime.learn.shared_vec_env import SharedVecEnv
from pianomime.learn.tensors import Arrays


class Ppo(PPO):
    """PPO that leaves the cores to whoever needs them.

    Attributes:
        threads: of the networks in updates.
    """

    threads: int

    def collect_rollouts(self, *arguments: Any, **named: Any) -> bool:
        """Play. Threads of networks that wait for the next pass would keep cores from physics."""
        with torch_threads(1):
            return super().collect_rollouts(*arguments, **named)

    def train(self) -> None:
        """Learn, with the products of matrices in bfloat16 (sums in float32) where that is faster.

        They are most of an update.
        """
        precision = torch.get_float32_matmul_precision()
        torch.set_float32_matmul_precision("medium")
        try:
            with torch_threads(self.threads):
                super().train()
        finally:
            torch.set_float32_matmul_precision(precision)


@contextmanager
def torch_threads(threads: int) -> Iterator[None]:
    """So many threads for torch, for a while."""
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class Boundary(BaseCallback):
    """What happens between updates: something is kept, and the next begins the same each time.

    Args:
        env: where it learns.
        seed: of all that is drawn.
        steps_per_update: in all environments together.
    """

    def __init__(self, env: SharedVecEnv, seed: int, steps_per_update: int) -> None:
        super().__init__()
        self._env, self._seed, self._steps_per_update = env, seed, steps_per_update
        self._fresh = True

    @abstractmethod
    def keep(self, update: int, steps: int) -> None:
        """Keep what was learned in this many updates and steps."""

    def arrays(self) -> Arrays:
        """Everything that is needed to go on."""
        arrays = model_arrays(self.model)
        return arrays | {f"env/{name}": array for name, array in self._env.state().items()}

    def resume(self, arrays: Arrays, steps: int, path: Path) -> None:
        """Put model and environments where a checkpoint has them.

        Raises:
            InputError: it is that of another model.
        """
        self.model.num_timesteps = steps
        self._env.resume(resume_model(self.model, arrays, path))
        self._fresh = False

    def between_updates(self) -> None:
        """Keep what was learned, and begin the next update."""
        steps = self.model.num_timesteps
        update = steps // self._steps_per_update
        # A checkpoint that was just read needs not be written again.
        if self._fresh:
            self._env.set_state(self._env.state())
            self.keep(update, steps)
        self._fresh = True
        seed_update(self._seed, update)
        self._env.reseed(self._seed, update)

    def _on_rollout_start(self) -> None:
        self.between_updates()

    def _on_step(self) -> bool:
        return True


def model_arrays(model: Any) -> Arrays:
    """Weights and moments of a model."""
    arrays: Arrays = {}
    for name, tensor in model.policy.state_dict().items():
        arrays[f"policy/{name}"] = tensor.numpy()
    for index, fields in model.policy.optimizer.state_dict()["state"].items():
        for field, tensor in fields.items():
            arrays[f"adam/{index}/{field}"] = tensor.numpy()
    return arrays


def resume_model(model: Any, arrays: Arrays, path: Path) -> Arrays:
    """Put a model where `model_arrays` had it; the arrays that are not its own, as "env/NAME".

    Args:
        model: made alike.
        arrays: of a checkpoint.
        path: of it.

    Raises:
        InputError: they are those of another model.
    """
    parts: dict[str, Arrays] = {"policy": {}, "adam": {}, "env": {}}
    for name, array in arrays.items():
        part, _, rest = name.partition("/")
        parts[part][rest] = array
    try:
        model.policy.load_state_dict(_tensors(parts["policy"]))
    except RuntimeError as error:
        raise InputError(f"{path}: the checkpoint does not fit the config") from error
    optimizer = model.policy.optimizer
    known = optimizer.state_dict()
    known["state"] = {}
    for name, tensor in _tensors(parts["adam"]).items():
        index, _, field = name.partition("/")
        known["state"].setdefault(int(index), {})[field] = tensor
    optimizer.load_state_dict(known)
    return parts["env"]


def actor_network(model: Any) -> torch.nn.Sequential:
    """The actor alone, from observations to mean actions."""
    return torch.nn.Sequential(*model.policy.mlp_extractor.policy_net, model.policy.action_net)


def seed_update(seed: int, update: int) -> None:
    """Make all that is drawn in an update depend on these two alone."""
    draws = np.random.SeedSequence([seed, update]).generate_state(3)
    torch.manual_seed(int(draws[0]))
    np.random.seed(int(draws[1]))  # noqa: NPY002 - Stable-Baselines3 draws from it
    random.seed(int(draws[2]))


def _tensors(arrays: Arrays) -> dict[str, torch.Tensor]:
    return {name: torch.from_numpy(array.copy()) for name, array in arrays.items()}
