"""Many environments for Gymnasium, `gymnasium.make_vec("pianomime.learn:pianomime/Song-v0")`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from pianomime.learn.envs.config import EnvConfig
from pianomime.learn.envs.gym_env import action_space, make_batch, observation_space
from pianomime.learn.envs.observation import ObservationTerm
from pianomime.learn.envs.reward import RewardTerm
from pianomime.plan.demonstration import Demonstration

_Rows = NDArray[np.float32]


class SongVectorEnv(VectorEnv[_Rows, _Rows, NDArray[Any]]):
    """As `SongEnv`, for many; an episode that ends begins again in the same step.

    `info` has arrays with an entry for each environment.

    Args:
        demonstration: as for `SongEnv`.
        config: as for `SongEnv`.
        num_envs: number of environments.
        threads: how many step at the same time; 0 for one on each core.
        extra_rewards: as for `SongEnv`.
        extra_observations: as for `SongEnv`.

    Raises:
        InputError: as from `SongEnv`.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self,
        demonstration: Demonstration | str | Path,
        config: EnvConfig | str = "paper",
        num_envs: int = 1,
        threads: int = 0,
        extra_rewards: Sequence[RewardTerm] = (),
        extra_observations: Sequence[ObservationTerm] = (),
    ) -> None:
        self.batch = make_batch(
            demonstration, config, num_envs, threads, extra_rewards, extra_observations
        )
        self.num_envs = num_envs
        self.single_observation_space = observation_space(self.batch)
        self.single_action_space = action_space(self.batch)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def __str__(self) -> str:
        """The environment's name, and the table of its terms."""
        return f"{type(self).__name__}\n{self.batch}"

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Rows, dict[str, Any]]:
        """Begin an episode in every environment."""
        if isinstance(seed, list):
            # One generator draws for all of them.
            given = [one for one in seed if one is not None]
            seed = int(np.random.SeedSequence(given).generate_state(1)[0]) if given else None
        super().reset(seed=seed)
        self.batch.reset(self.np_random)
        return self.batch.observations.copy(), {"frame": self.batch.frames.copy()}

    def step(
        self, actions: _Rows
    ) -> tuple[_Rows, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Play one frame in every environment."""
        step = self.batch.step(actions)
        info: dict[str, Any] = {
            "frame": self.batch.frames.copy(),
            "f1": step.f1,
            "blow_ups": step.blow_ups,
            **{f"reward/{name}": value for name, value in step.rewards.items()},
        }
        ended = step.terminated | step.truncated
        if ended.any():
            final = {name: values.copy() for name, values in info.items()}
            info["final_obs"] = np.full(self.num_envs, None, object)
            for row in np.flatnonzero(ended):
                info["final_obs"][row] = self.batch.observations[row].copy()
            info["_final_obs"] = ended
            info["final_info"] = final
            info["_final_info"] = ended
            self.batch.reset(self.np_random, np.flatnonzero(ended))
            # These are now of the episodes that begin; the rewards are still of this step.
            info["frame"] = self.batch.frames.copy()
            info["f1"] = np.where(ended, 0.0, step.f1)
            info["blow_ups"] = np.where(ended, 0, step.blow_ups)
        return (
            self.batch.observations.copy(),
            step.reward,
            step.terminated,
            step.truncated,
            info,
        )
