"""Many environments at once for Stable-Baselines3."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from pianomime.learn.song_batch import SongBatch
from pianomime.learn.song_env import action_space, observation_space


class SongVecEnv(VecEnv):
    """A SongBatch as Stable-Baselines3 wants it: what ends begins again in the same step.

    Attributes:
        batch: the environments.

    Args:
        batch: the environments.
    """

    def __init__(self, batch: SongBatch) -> None:
        self.batch = batch
        self._resumed = False
        self.render_mode = None
        self._actions = np.zeros((len(batch), batch.actions), np.float32)
        self._draw = np.random.default_rng(0)
        super().__init__(len(batch), observation_space(batch), action_space(batch))

    def reseed(self, *seed: int) -> None:
        """What is drawn from now on depends on nothing but this."""
        self._draw = np.random.default_rng(seed)

    def resume(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from a moment; the next `reset` leaves it as it is."""
        self.batch.set_state(state)
        self._resumed = True

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode in every environment."""
        if self._seeds[0] is not None:
            self.reseed(self._seeds[0])
        if not self._resumed:
            self.batch.reset(self._draw)
        self._resumed = False
        self._reset_seeds()
        self._reset_options()
        return self.batch.observations.copy()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Play one frame in every environment."""
        step = self.batch.step(self._actions)
        done = step.terminated | step.truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        ended = np.flatnonzero(done)
        for row in ended:
            infos[row] = {
                "terminal_observation": self.batch.observations[row].copy(),
                "TimeLimit.truncated": bool(step.truncated[row]),
                "f1": float(step.f1[row]),
                "blow_ups": int(step.blow_ups[row]),
            }
        if len(ended):
            self.batch.reset(self._draw, ended)
        return self.batch.observations.copy(), step.reward.astype(np.float32), done, infos

    def close(self) -> None:
        """Nothing is held open."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the batch, which all environments share."""
        if attr_name == "render_mode":
            return [None] * self.num_envs
        return [getattr(self.batch, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """There is nothing to set: environments share what they have."""
        raise AttributeError(f"cannot set {attr_name}: all environments share one batch")

    def env_method(
        self, method_name: str, *arguments: Any, indices: VecEnvIndices = None, **named: Any
    ) -> list[Any]:
        """There are no methods of a single environment."""
        raise AttributeError(f"there is no method {method_name} of a single environment")

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """No environment is wrapped."""
        return [False for _ in self._get_indices(indices)]
