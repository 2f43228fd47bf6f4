"""What happens between updates of Stable-Baselines3, and what it takes to go on from there."""

from __future__ import annotations

import random
from abc import abstractmethod
from pathlib import Path

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from pianomime.errors import InputError
from pianomime.learn.envs.sb3_base import Sb3BaseEnv
from pianomime.learn.runs.safetensors_file import Arrays


class ResumableCallback(BaseCallback):
    """What happens between updates: something is kept, and the next begins the same each time.

    Args:
        env: where it learns.
        seed: of all that is drawn.
        steps_per_update: in all environments together.
    """

    def __init__(self, env: Sb3BaseEnv, seed: int, steps_per_update: int) -> None:
        super().__init__()
        self._env, self._seed, self._steps_per_update = env, seed, steps_per_update
        self._fresh = True

    @abstractmethod
    def keep(self, update: int, steps: int) -> None:
        """Keep what was learned in this many updates and steps."""

    def arrays(self) -> Arrays:
        """Everything that is needed to go on."""
        weights = self.model.policy.state_dict()
        arrays = {f"policy/{name}": tensor.numpy() for name, tensor in weights.items()}
        for name, optimizer in self.optimizers().items():
            for index, fields in optimizer.state_dict()["state"].items():
                for field, tensor in fields.items():
                    arrays[f"{name}/{index}/{field}"] = tensor.numpy()
        return arrays | {f"env/{name}": array for name, array in self._env.state().items()}

    def optimizers(self) -> dict[str, torch.optim.Optimizer]:
        """Those whose moments are kept, by name."""
        return {"adam": self.model.policy.optimizer}

    def resume(self, arrays: Arrays, steps: int, path: Path) -> None:
        """Put model and environments where a checkpoint has them.

        Raises:
            InputError: it is that of another model.
        """
        parts: dict[str, Arrays] = {}
        for name, array in arrays.items():
            part, _, rest = name.partition("/")
            parts.setdefault(part, {})[rest] = array
        try:
            self.model.policy.load_state_dict(_tensors(parts["policy"]))
            for name, optimizer in self.optimizers().items():
                known = optimizer.state_dict()
                known["state"] = {}
                for place, tensor in _tensors(parts.get(name, {})).items():
                    index, _, field = place.partition("/")
                    known["state"].setdefault(int(index), {})[field] = tensor
                optimizer.load_state_dict(known)
            self._env.resume(parts["env"])
        except (RuntimeError, LookupError, ValueError) as error:
            raise InputError(f"{path}: the checkpoint does not fit the config") from error
        self.model.num_timesteps = steps
        self._fresh = False

    def learn(
        self, model: BaseAlgorithm, steps: int, state: tuple[Arrays, int] | None, path: Path
    ) -> None:
        """Have a model learn until it has done so many steps, from a checkpoint on if there is one.

        Args:
            model: made for the environments.
            steps: in all, those before the checkpoint among them.
            state: the checkpoint, and the steps done by then.
            path: of it.

        Raises:
            InputError: it is that of another model.
        """
        self.init_callback(model)
        if state is not None:
            self.resume(*state, path)
        # Steps that were taken before are added to those that it is told.
        model.learn(steps - model.num_timesteps, self, reset_num_timesteps=state is None)

    def between_updates(self) -> None:
        """Keep what was learned, and begin the next update."""
        steps = self.model.num_timesteps
        update = steps // self._steps_per_update
        # A checkpoint that was just read needs not be written again.
        if self._fresh:
            self._env.set_state(self._env.state())
            self.keep(update, steps)
        self._fresh = True
        draws = np.random.SeedSequence([self._seed, update]).generate_state(4).tolist()
        torch.manual_seed(draws[0])
        np.random.seed(draws[1])  # noqa: NPY002 - Stable-Baselines3 draws from it
        random.seed(draws[2])
        self._env.action_space.seed(draws[3])
        self._env.reseed(self._seed, update)

    def _on_rollout_start(self) -> None:
        self.between_updates()

    def _on_step(self) -> bool:
        return True


def _tensors(arrays: Arrays) -> dict[str, torch.Tensor]:
    return {name: torch.from_numpy(array.copy()) for name, array in arrays.items()}
