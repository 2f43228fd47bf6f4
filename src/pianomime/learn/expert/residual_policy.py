"""The actor of an expert: a small network, from observations to mean actions."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.envs.batch import prior_tracker
from pianomime.learn.envs.observation import Observer
from pianomime.learn.expert.config import ExpertConfig, PpoConfig
from pianomime.learn.runs.safetensors_file import Arrays
from pianomime.plan import FingertipPlan
from pianomime.plan.demonstration import Demonstration
from pianomime.world import World

ACTIVATIONS = {"gelu": torch.nn.GELU, "relu": torch.nn.ReLU, "tanh": torch.nn.Tanh}


def actor(config: PpoConfig, observations: int, actions: int) -> torch.nn.Sequential:
    """The network without its weights."""
    layers: list[torch.nn.Module] = []
    wide = observations
    for hidden in config.hidden:
        layers += [torch.nn.Linear(wide, hidden), ACTIVATIONS[config.activation]()]
        wide = hidden
    return torch.nn.Sequential(*layers, torch.nn.Linear(wide, actions))


class ResidualPolicyTracker:
    """Adds a policy's residual to what the prior proposes; works the pedal where it has learned to.

    Args:
        song: what it was trained on.
        config: how.
        network: the actor.
    """

    def __init__(
        self, song: Demonstration, config: ExpertConfig, network: torch.nn.Sequential
    ) -> None:
        self._prior = prior_tracker(config.env)
        self._observer = Observer(config.env.observation, song.score.roll(), song.plan)
        self._reach = config.env.action.factor * self._observer.ctrl_range
        self._network = network
        self._pedal = song.score.pedal_roll()
        self._works_pedal = config.env.action.pedal
        self._row = np.zeros((1, self._observer.size), np.float32)

    @classmethod
    def from_arrays(
        cls, song: Demonstration, config: ExpertConfig, arrays: Arrays
    ) -> ResidualPolicyTracker:
        """With the weights of a trained actor.

        Raises:
            InputError: they are those of another network.
        """
        observer = Observer(config.env.observation, song.score.roll(), song.plan)
        network = actor(config.ppo, observer.size, 46 + config.env.action.pedal)
        weights = {name: torch.from_numpy(array.copy()) for name, array in arrays.items()}
        try:
            network.load_state_dict(weights)
        except RuntimeError as error:
            raise InputError("the expert's weights do not fit its config") from error
        return cls(song, config, network)

    def begin(self, plan: FingertipPlan) -> None:
        """Prepare the prior."""
        self._prior.begin(plan)

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) the prior's control and the mean of the policy's residual."""
        frames = np.array([frame])
        prior, points = self._prior.controls(frames, world.qpos[None])
        self._observer.write(
            self._row,
            np.array([0]),
            frames,
            world.qpos_hands[None],
            world.qvel_hands[None],
            world.key_state[None],
            points[:, :, 1:],
            prior,
            np.array([world.pedal]),
        )
        with torch.inference_mode():
            action = self._network(torch.from_numpy(self._row))[0].numpy().astype(np.float64)
        if self._works_pedal:
            self._pedal[frame] = action[46] > 0.0
        residual: NDArray[np.float64] = self._reach * np.clip(action[:46], -1.0, 1.0)
        ctrl: NDArray[np.float64] = prior[0] + residual
        return ctrl

    def pedal(self, frame: int) -> bool:
        """The policy's pedal, or the score's."""
        return bool(self._pedal[frame])
