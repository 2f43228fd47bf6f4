"""Base class of vector environments for Stable-Baselines3 that step together as one."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from pianomime.learn.runs.safetensors_file import Arrays


class Sb3BaseEnv(VecEnv):
    """Environments that step together; an episode that ends begins again in the same step.

    Attributes:
        rng: generator of all random numbers.

    Args:
        num_envs: number of environments.
        observation_space, action_space: of one environment.
    """

    def __init__(
        self,
        num_envs: int,
        observation_space: gymnasium.spaces.Box,
        action_space: gymnasium.spaces.Box,
    ) -> None:
        self.render_mode = None
        self.rng = np.random.default_rng(0)
        self._resumed = False
        self._actions = np.zeros((num_envs, *action_space.shape), np.float32)
        super().__init__(num_envs, observation_space, action_space)

    @abstractmethod
    def begin_episodes(self) -> None:
        """Begin an episode in every environment."""

    @abstractmethod
    def observations(self) -> NDArray[np.float32]:
        """(num_envs, size) the present observations."""

    @abstractmethod
    def step_frame(self, actions: NDArray[Any]) -> VecEnvStepReturn:
        """Play one frame in every environment.

        Args:
            actions: (num_envs, size) -1..1.
        """

    @abstractmethod
    def state(self) -> Arrays:
        """The state of all environments, for `set_state`."""

    @abstractmethod
    def set_state(self, state: Arrays) -> None:
        """Go to a state that `state` gave; what follows is the same each time."""

    def resume(self, state: Arrays) -> None:
        """Go to a state that `state` gave, which the next `reset` leaves as it is."""
        self.set_state(state)
        self._resumed = True

    def reseed(self, *seed: int) -> None:
        """Make all random numbers from now on depend on nothing but this."""
        self.rng = np.random.default_rng(seed)

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode in every environment, or go on where `resume` put them."""
        if self._seeds[0] is not None:
            self.reseed(self._seeds[0])
        if not self._resumed:
            self.begin_episodes()
        self._resumed = False
        self._reset_seeds()
        self._reset_options()
        return self.observations()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Play one frame in every environment."""
        return self.step_frame(self._actions)

    def close(self) -> None:
        """Nothing is held open."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute that all environments share, once for each."""
        if attr_name == "render_mode":
            return [None] * self.num_envs
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Refuse: the environments have no attributes of their own."""
        raise AttributeError(f"cannot set {attr_name}: all environments share one batch")

    def env_method(
        self, method_name: str, *arguments: Any, indices: VecEnvIndices = None, **named: Any
    ) -> list[Any]:
        """Refuse: the environments have no methods of their own."""
        raise AttributeError(f"there is no method {method_name} of a single environment")

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """No environment is wrapped."""
        return [False for _ in self._get_indices(indices)]
