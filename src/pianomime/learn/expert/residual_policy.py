"""The policy of an expert: a small network whose output is added to the base controller's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.envs.batch import base_controller
from pianomime.learn.envs.config import EnvConfig
from pianomime.learn.envs.observation import Observer, control_range, default_observation_terms
from pianomime.learn.envs.reference import Reference
from pianomime.learn.envs.state import EnvState
from pianomime.learn.expert.config import ExpertConfig, PpoConfig
from pianomime.learn.runs.safetensors_file import Arrays
from pianomime.plan import FingertipPlan
from pianomime.plan.demonstration import Demonstration
from pianomime.world import World
from pianomime.world.layout import LAYOUT

ACTIVATIONS = {"gelu": torch.nn.GELU, "relu": torch.nn.ReLU, "tanh": torch.nn.Tanh}


def actor(config: PpoConfig, observation_size: int, action_size: int) -> torch.nn.Sequential:
    """The network of a policy, with random weights.

    Args:
        config: hidden layers and activation.
        observation_size: numbers in an observation.
        action_size: numbers in an action.
    """
    layers: list[torch.nn.Module] = []
    width = observation_size
    for hidden in config.hidden:
        layers += [torch.nn.Linear(width, hidden), ACTIVATIONS[config.activation]()]
        width = hidden
    return torch.nn.Sequential(*layers, torch.nn.Linear(width, action_size))


class ResidualPolicyTracker:
    """Adds a policy's residual to the controls of the base controller.

    Args:
        demonstration: what the policy was trained on.
        config: how it was trained.
        network: from observations to mean actions.
    """

    def __init__(
        self, demonstration: Demonstration, config: ExpertConfig, network: torch.nn.Sequential
    ) -> None:
        self._reference = Reference.of(demonstration)
        self._config, self._network = config.env, network

    @classmethod
    def from_arrays(
        cls, demonstration: Demonstration, config: ExpertConfig, arrays: Arrays
    ) -> ResidualPolicyTracker:
        """A tracker with the weights of a trained policy.

        Args:
            demonstration: what the policy was trained on.
            config: how it was trained.
            arrays: weights of the network, by name.

        Raises:
            InputError: they are the weights of another network.
        """
        observer = Observer(default_observation_terms(config.env.observation))
        network = actor(config.ppo, observer.size, LAYOUT.ctrl_size + config.env.action.pedal)
        try:
            network.load_state_dict(
                {name: torch.from_numpy(array.copy()) for name, array in arrays.items()}
            )
        except (RuntimeError, TypeError) as error:
            raise InputError("the expert's weights do not fit its config") from error
        return cls(demonstration, config, network)

    def start(self, plan: FingertipPlan) -> ResidualPolicyController:
        """A controller for the song that the policy was trained on.

        Args:
            plan: of that song.
        """
        reference = replace(self._reference, plan=plan)
        return ResidualPolicyController(reference, self._config, self._network)


class ResidualPolicyController:
    """Plays one song; works the pedal if the policy was trained to.

    Attributes:
        plan: what is to be played.

    Args:
        reference: goals, pedal and plan of the song.
        config: of the environment that the policy was trained in.
        network: from observations to mean actions.
    """

    replayable = True

    def __init__(
        self, reference: Reference, config: EnvConfig, network: torch.nn.Sequential
    ) -> None:
        self.plan = reference.plan
        self._reference, self._network = reference, network
        self._base = base_controller(config, reference.plan)
        self._observer = Observer(default_observation_terms(config.observation))
        self._residual_range = config.action.factor * control_range()
        self._works_pedal = config.action.pedal
        self._pedal = reference.pedal.copy()
        self._row = np.zeros((1, self._observer.size), np.float32)
        self._no_action = np.zeros((1, LAYOUT.ctrl_size + config.action.pedal))

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) the base controller's control plus the residual of the mean action [rad, m]."""
        frames = np.array([frame])
        base_control, points = self._base.controls(frames, world.qpos[None])
        state = EnvState(
            reference=self._reference,
            frames=frames,
            joints=world.qpos_hands[None],
            velocities=world.qvel_hands[None],
            key_state=world.key_state[None],
            pressed=world.pressed[None],
            tips=points[:, :, 1:],
            pedal=np.array([world.pedal]),
            base_control=base_control,
            action=self._no_action,
        )
        self._observer.write(self._row, np.array([0]), state)
        with torch.inference_mode():
            action = self._network(torch.from_numpy(self._row))[0].numpy().astype(np.float64)
        if self._works_pedal:
            self._pedal[frame] = action[LAYOUT.ctrl_size] > 0.0
        residual: NDArray[np.float64] = self._residual_range * np.clip(
            action[: LAYOUT.ctrl_size], -1.0, 1.0
        )
        ctrl: NDArray[np.float64] = base_control[0] + residual
        return ctrl

    def pedal(self, frame: int) -> bool:
        """The policy's pedal, or the score's."""
        return bool(self._pedal[frame])
