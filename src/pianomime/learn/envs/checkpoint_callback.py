"""Callback of Stable-Baselines3 that saves checkpoints between updates and resumes from them.

It reseeds all generators between updates, so that a resumed run equals an uninterrupted one bit
for bit.
"""

from __future__ import annotations

import random
from abc import abstractmethod
from pathlib import Path

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback

from pianomime.errors import InputError, TrainingDiverged
from pianomime.learn.envs.sb3_base import Sb3BaseEnv
from pianomime.learn.runs.run import Checkpoint
from pianomime.learn.runs.safetensors_file import Arrays


class ResumableCallback(BaseCallback):
    """Saves between updates, and makes each update depend on the saved state and the seed alone.

    Args:
        env: what the model learns in.
        seed: seed of all random numbers.
        steps_per_update: control steps between updates, in all environments together.
    """

    def __init__(self, env: Sb3BaseEnv, seed: int, steps_per_update: int) -> None:
        super().__init__()
        self._env, self._seed, self._steps_per_update = env, seed, steps_per_update
        self._fresh = True

    @abstractmethod
    def save(self, update: int, steps: int) -> None:
        """Save what was learned.

        Args:
            update: number of updates so far.
            steps: number of control steps so far.
        """

    def arrays(self) -> Arrays:
        """Everything that a checkpoint holds: weights, optimizers and environments, by name."""
        weights = self.model.policy.state_dict()
        arrays = {f"policy/{name}": tensor.numpy() for name, tensor in weights.items()}
        for name, optimizer in self.optimizers().items():
            for index, fields in optimizer.state_dict()["state"].items():
                for field, tensor in fields.items():
                    arrays[f"{name}/{index}/{field}"] = tensor.numpy()
        return arrays | {f"env/{name}": array for name, array in self._env.state().items()}

    def optimizers(self) -> dict[str, torch.optim.Optimizer]:
        """The optimizers whose state is saved, by name."""
        return {"adam": self.model.policy.optimizer}

    def resume(self, arrays: Arrays, steps: int, path: Path) -> None:
        """Put the model and the environments into the state of a checkpoint.

        Args:
            arrays: as `arrays` gave them.
            steps: number of control steps by then.
            path: of the checkpoint, for messages.

        Raises:
            InputError: it is the checkpoint of another model.
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
        except (RuntimeError, LookupError, ValueError, TypeError) as error:
            raise InputError(f"{path}: the checkpoint does not fit the config") from error
        self.model.num_timesteps = steps
        self._fresh = False

    def learn(self, model: BaseAlgorithm, steps: int, state: Checkpoint | None, path: Path) -> None:
        """Train a model up to a number of steps, from a checkpoint on if there is one.

        Args:
            model: made for the environments.
            steps: control steps in all, including those before the checkpoint.
            state: arrays of the checkpoint and the steps by then; None to begin.
            path: of the checkpoint, for messages.

        Raises:
            InputError: it is the checkpoint of another model.
            TrainingDiverged: the policy gives no finite numbers any more; the checkpoint before
                stays.
        """
        self.init_callback(model)
        if state is not None:
            self.resume(state.arrays, state.steps, path)
        try:
            # Stable-Baselines3 adds the steps that were taken before to this number.
            model.learn(steps - model.num_timesteps, self, reset_num_timesteps=state is None)
        except ValueError as error:
            # Torch's distributions of actions refuse what is no number.
            if "satisfy the constraint" not in str(error):
                raise
            raise self._diverged() from error
        self._check_finite()

    def between_updates(self) -> None:
        """Save, and seed the next update."""
        steps = self.model.num_timesteps
        update = steps // self._steps_per_update
        # A checkpoint that was just read need not be written again.
        if self._fresh:
            self._check_finite()
            self._env.set_state(self._env.state())
            self.save(update, steps)
        self._fresh = True
        seeds = np.random.SeedSequence([self._seed, update]).generate_state(4).tolist()
        torch.manual_seed(seeds[0])
        np.random.seed(seeds[1])  # noqa: NPY002 - Stable-Baselines3 uses it
        random.seed(seeds[2])
        self._env.action_space.seed(seeds[3])
        self._env.reseed(self._seed, update)

    def _check_finite(self) -> None:
        """Refuse to go on with weights that are not numbers.

        Raises:
            TrainingDiverged: one is not finite.
        """
        weights = self.model.policy.state_dict().values()
        if not all(bool(torch.isfinite(tensor).all()) for tensor in weights):
            raise self._diverged()

    def _diverged(self) -> TrainingDiverged:
        return TrainingDiverged(
            f"the policy gives no finite numbers at step {self.model.num_timesteps}: "
            "try a lower learning rate, in another folder"
        )

    def _on_rollout_start(self) -> None:
        self.between_updates()

    def _on_step(self) -> bool:
        return True


def _tensors(arrays: Arrays) -> dict[str, torch.Tensor]:
    return {name: torch.from_numpy(array.copy()) for name, array in arrays.items()}
