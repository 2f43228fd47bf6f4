"""What Stable-Baselines3 asks of environments that share everything they have."""

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
    """Environments that are stepped as one: what ends begins again in the same step.

    Attributes:
        draw: of all that is drawn.

    Args:
        count: number of environments.
        observations, actions: their spaces.
    """

    def __init__(
        self, count: int, observations: gymnasium.spaces.Box, actions: gymnasium.spaces.Box
    ) -> None:
        self.render_mode = None
        self.draw = np.random.default_rng(0)
        self._resumed = False
        self._actions = np.zeros((count, *actions.shape), np.float32)
        super().__init__(count, observations, actions)

    @abstractmethod
    def begin(self) -> None:
        """Begin an episode in every environment."""

    @abstractmethod
    def look(self) -> NDArray[np.float32]:
        """The observations of the present moment."""

    @abstractmethod
    def play(self, actions: NDArray[Any]) -> VecEnvStepReturn:
        """Play one frame in every environment."""

    @abstractmethod
    def state(self) -> Arrays:
        """The present moment of all environments, for `set_state`."""

    @abstractmethod
    def set_state(self, state: Arrays) -> None:
        """Go to a moment that `state` gave; what follows is the same each time."""

    def resume(self, state: Arrays) -> None:
        """As `set_state`; the next `reset` leaves it as it is."""
        self.set_state(state)
        self._resumed = True

    def reseed(self, *seed: int) -> None:
        """What is drawn from now on depends on nothing but this."""
        self.draw = np.random.default_rng(seed)

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode in every environment, or go on where `resume` put them."""
        if self._seeds[0] is not None:
            self.reseed(self._seeds[0])
        if not self._resumed:
            self.begin()
        self._resumed = False
        self._reset_seeds()
        self._reset_options()
        return self.look()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Play one frame in every environment."""
        return self.play(self._actions)

    def close(self) -> None:
        """Nothing is held open."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of what all environments share."""
        if attr_name == "render_mode":
            return [None] * self.num_envs
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

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
