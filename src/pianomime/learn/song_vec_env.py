"""Many environments of one song at once for Stable-Baselines3."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from pianomime.learn.shared_vec_env import SharedVecEnv
from pianomime.learn.song_batch import SongBatch
from pianomime.learn.song_env import action_space, observation_space


class SongVecEnv(SharedVecEnv):
    """A SongBatch as Stable-Baselines3 wants it: what ends begins again in the same step.

    Attributes:
        batch: the environments.

    Args:
        batch: the environments.
    """

    def __init__(self, batch: SongBatch) -> None:
        self.batch = batch
        self._resumed = False
        super().__init__(len(batch), observation_space(batch), action_space(batch))

    def resume(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from a moment; the next `reset` leaves it as it is."""
        self.batch.set_state(state)
        self._resumed = True

    def begin(self) -> NDArray[np.float32]:
        """Begin an episode in every environment."""
        if not self._resumed:
            self.batch.reset(self.draw)
        self._resumed = False
        return self.batch.observations.copy()

    def play(self, actions: NDArray[Any]) -> VecEnvStepReturn:
        """Play one frame in every environment."""
        step = self.batch.step(actions)
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
            self.batch.reset(self.draw, ended)
        return self.batch.observations.copy(), step.reward.astype(np.float32), done, infos

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the batch, which all environments share."""
        if attr_name == "render_mode":
            return [None] * self.num_envs
        return [getattr(self.batch, attr_name) for _ in self._get_indices(indices)]
