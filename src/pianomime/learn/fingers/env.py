"""Environment of the finger residual: many songs side by side, ten agents in each world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.learn.envs.sb3_multi_song import PlayedFrame, Sb3MultiSongEnv
from pianomime.learn.fingers.config import FingersConfig
from pianomime.music import Score
from pianomime.plan import ZeroShotPlanner
from pianomime.plan.demonstration import Demonstration
from pianomime.policies.finger_residual import ACTIONS, AGENTS, SIZE, FingerObservation, controls
from pianomime.short_repr import short_repr
from pianomime.track import DynamicTracker
from pianomime.track.dynamic import DynamicController
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres

_DEPTH_SHARE = 0.2
"""Reward for how far the own key is down, beside 1 for that it sounds; scaled to 1 together."""


@dataclass(frozen=True, eq=False)
class PlannedSong:
    """A song with its plan and base controller.

    Attributes:
        demonstration: score and zero-shot plan.
        goal: (T, 88) bool, keys that should sound.
        pedal: (T,) bool, the pedal of the score.
        controller: the base controller, that of the dynamic tracker.
        observation: encodes the observations of the fingers.
    """

    demonstration: Demonstration
    goal: NDArray[np.bool_]
    pedal: NDArray[np.bool_]
    controller: DynamicController
    observation: FingerObservation

    __repr__ = short_repr

    @classmethod
    def of(cls, score: Score) -> PlannedSong:
        """A score with the plan of the zero-shot planner."""
        plan = ZeroShotPlanner().plan(score)
        controller = DynamicTracker().start(plan)
        return cls(
            Demonstration(score, plan),
            score.roll(),
            score.pedal_roll(),
            controller,
            FingerObservation(controller),
        )


class FingersVecEnv(Sb3MultiSongEnv):
    """Ten agents in each world: its fingers.

    `pianomime.policies.finger_residual` defines their observations and actions, `finger_rewards`
    their rewards.

    Args:
        songs: songs to play.
        config: number of worlds, and costs of the reward.
        threads: how many worlds step at the same time; 0 for one on each core.
    """

    def __init__(self, songs: list[PlannedSong], config: FingersConfig, threads: int = 0) -> None:
        self._planned, self._config = songs, config
        self._base = np.zeros((config.num_envs, LAYOUT.ctrl_size))
        self._tips = np.zeros((config.num_envs, AGENTS, 3))
        self._observations = np.zeros((config.num_envs, AGENTS, SIZE), np.float32)
        super().__init__(songs, config.num_envs, AGENTS, SIZE, ACTIONS, threads)

    def agent_observations(self) -> NDArray[np.float32]:
        """As `Sb3MultiSongEnv.agent_observations`; also asks the base controllers."""
        qpos, velocities = self.worlds.qpos, self.worlds.qvel_hands
        keys = self.worlds.key_state
        for row, (number, frame) in enumerate(self.rows.tolist()):
            song = self._planned[number]
            base, points = song.controller.controls(np.array([frame]), qpos[row : row + 1])
            self._base[row] = base[0]
            self._tips[row] = points[0, :, 1:].reshape(AGENTS, 3)
            self._observations[row] = song.observation.encode(
                frame, qpos[row], velocities[row], keys[row], points[0]
            )
        return self._observations.copy()

    def controls(self, actions: NDArray[Any]) -> NDArray[np.float64]:
        """As `Sb3MultiSongEnv.controls`."""
        ctrl: NDArray[np.float64] = self._base + np.array([controls(one) for one in actions])
        return ctrl

    def rewards(self, played: PlayedFrame, actions: NDArray[Any]) -> NDArray[np.float64]:
        """As `Sb3MultiSongEnv.rewards`: `finger_rewards` less the cost of the actions."""
        keys = np.array(
            [self._planned[number].demonstration.plan.finger_key[at] for number, at in played.rows]
        )
        cost = self._config.wrong_key_cost
        reward = finger_rewards(
            played.pressed, played.key_state, played.goal, keys, self._tips, cost
        )
        reward -= self._config.action_cost * (actions**2).mean(axis=2)
        return reward


def finger_rewards(
    pressed: NDArray[np.bool_],
    key_state: NDArray[np.float64],
    goal: NDArray[np.bool_],
    finger_key: NDArray[np.int8],
    tips: NDArray[np.float64],
    wrong_key_cost: float,
) -> NDArray[np.float64]:
    """(B, 10) rewards of the fingers for the keys as they are.

    A finger earns 1 for its own key fully pressed. Every pressed key that is not in the goal costs
    the finger that is nearest to it.

    Args:
        pressed: (B, 88) keys that sound.
        key_state: (B, 88) how far each key is down, 0..1.
        goal: (B, 88) keys that should sound.
        finger_key: (B, 2, 5) the key that each finger was to press, -1 for none.
        tips: (B, 10, 3) fingertips, world frame [m].
        wrong_key_cost: cost of a key that is not in the goal.
    """
    own = finger_key.reshape(len(pressed), AGENTS).astype(np.int64)
    at = np.maximum(own, 0)
    depth = np.take_along_axis(key_state, at, axis=1)
    down = np.take_along_axis(pressed, at, axis=1) + _DEPTH_SHARE * depth
    reward: NDArray[np.float64] = np.where(own >= 0, down / (1.0 + _DEPTH_SHARE), 0.0)
    rows, keys = np.nonzero(pressed & ~goal)
    distance = np.linalg.norm((tips[rows] - key_centres()[keys, None])[..., 1:], axis=2)
    np.subtract.at(reward, (rows, distance.argmin(axis=1)), wrong_key_cost)
    return reward
