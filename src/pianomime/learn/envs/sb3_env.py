"""Many environments of one song at once for Stable-Baselines3."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from pianomime.learn.envs.batch import SongBatch
from pianomime.learn.envs.gym_env import action_space, observation_space
from pianomime.learn.envs.sb3_base import Sb3BaseEnv
from pianomime.learn.runs.safetensors_file import Arrays


class Sb3Env(Sb3BaseEnv):
    """A SongBatch as a vector environment of Stable-Baselines3.

    `infos` has what each reward term gave (`reward/press`, ...), and at the end of an episode its
    F1 and the frames in which the physics broke.

    Attributes:
        batch: the environments.

    Args:
        batch: the environments.
    """

    def __init__(self, batch: SongBatch) -> None:
        self.batch = batch
        self._info_names = [f"reward/{term.name}" for term in batch.reward_terms]
        super().__init__(len(batch), observation_space(batch), action_space(batch))

    def begin_episodes(self) -> None:
        """Begin an episode in every environment."""
        self.batch.reset(self.rng)

    def observations(self) -> NDArray[np.float32]:
        """(num_envs, size) the present observations."""
        return self.batch.observations.copy()

    def state(self) -> Arrays:
        """The state of all environments, for `set_state`."""
        return self.batch.state()

    def set_state(self, state: Arrays) -> None:
        """Go to a state that `state` gave; what follows is the same each time."""
        self.batch.set_state(state)

    def step_frame(self, actions: NDArray[Any]) -> VecEnvStepReturn:
        """Play one frame in every environment."""
        step = self.batch.step(actions)
        done = step.terminated | step.truncated
        by_term = [values.tolist() for values in step.rewards.values()]
        infos: list[dict[str, Any]] = [
            {name: values[row] for name, values in zip(self._info_names, by_term, strict=True)}
            for row in range(self.num_envs)
        ]
        ended = np.flatnonzero(done)
        for row in ended:
            infos[row] |= {
                "terminal_observation": self.batch.observations[row].copy(),
                "TimeLimit.truncated": bool(step.truncated[row]),
                "f1": float(step.f1[row]),
                "blow_ups": int(step.blow_ups[row]),
            }
        if len(ended):
            self.batch.reset(self.rng, ended)
        return self.observations(), step.reward.astype(np.float32), done, infos

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the batch, which all environments share, once for each."""
        if attr_name == "render_mode":
            return [None] * self.num_envs
        return [getattr(self.batch, attr_name) for _ in self._get_indices(indices)]
