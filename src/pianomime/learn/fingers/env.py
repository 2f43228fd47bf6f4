"""Worlds that play many songs, with ten fingers that learn in each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.learn.envs.sb3_multi_song import Played, Sb3MultiSongEnv
from pianomime.learn.fingers.config import FingersConfig
from pianomime.music import Score
from pianomime.plan import ZeroShotPlanner
from pianomime.plan.demonstration import Demonstration
from pianomime.policies.finger_residual import ACTIONS, SIZE, FingerObservation, controls
from pianomime.track import DynamicTracker
from pianomime.world.parameters import key_centres

AGENTS = 10


@dataclass(frozen=True, eq=False)
class PlannedSong:
    """A song, ready to be played.

    Attributes:
        demonstration: it, with its plan.
        goal: (T, 88) bool, what it wants.
        pedal: (T,) bool.
        tracker: that follows the plan.
        surroundings: what fingers are told of it.
    """

    demonstration: Demonstration
    goal: NDArray[np.bool_]
    pedal: NDArray[np.bool_]
    tracker: DynamicTracker
    surroundings: FingerObservation

    @classmethod
    def of(cls, score: Score) -> PlannedSong:
        """As the zero-shot planner plans it."""
        plan, tracker = ZeroShotPlanner().plan(score), DynamicTracker()
        tracker.begin(plan)
        return cls(
            Demonstration(score, plan),
            score.roll(),
            score.pedal_roll(),
            tracker,
            FingerObservation(plan, tracker),
        )


class FingersVecEnv(Sb3MultiSongEnv):
    """Ten fingers in every world.

    `pianomime.policies.finger_residual` has the observation and the action of a finger. Its reward
    is 1 for the key that it should press, down, and less for keys that nobody wants, of which each
    counts against the finger that is nearest.

    Args:
        songs: what is played.
        config: how.
        threads: how many worlds step at the same time; 0 for one on each core.
    """

    def __init__(self, songs: list[PlannedSong], config: FingersConfig, threads: int = 0) -> None:
        self._planned, self._config = songs, config
        self._proposed = np.zeros((config.worlds, 46))
        self._tips = np.zeros((config.worlds, AGENTS, 3))
        self._told = np.zeros((config.worlds, AGENTS, SIZE), np.float32)
        super().__init__(songs, config.worlds, AGENTS, SIZE, ACTIONS, threads)

    def see(self) -> NDArray[np.float32]:
        """As `Sb3MultiSongEnv.see`; and ask the tracker."""
        qpos, velocities = self.worlds.qpos, self.worlds.qvel_hands
        keys = self.worlds.key_state
        for row, (number, frame) in enumerate(self.rows.tolist()):
            song = self._planned[number]
            proposed, points = song.tracker.controls(np.array([frame]), qpos[row : row + 1])
            self._proposed[row] = proposed[0]
            self._tips[row] = points[0, :, 1:].reshape(AGENTS, 3)
            self._told[row] = song.surroundings.look(
                frame, qpos[row], velocities[row], keys[row], points[0]
            )
        return self._told.copy()

    def controls(self, said: NDArray[Any]) -> NDArray[np.float64]:
        """As `Sb3MultiSongEnv.controls`."""
        ctrl: NDArray[np.float64] = self._proposed + np.array([controls(one) for one in said])
        return ctrl

    def rewards(self, played: Played, said: NDArray[Any]) -> NDArray[np.float64]:
        """As `Sb3MultiSongEnv.rewards`."""
        keys = np.array(
            [self._planned[number].demonstration.plan.finger_key[at] for number, at in played.rows]
        )
        reward = finger_rewards(
            played.pressed, played.key_state, played.wanted, keys, self._tips, self._config.wrong
        )
        reward -= self._config.effort * (said**2).mean(axis=2)
        return reward


def finger_rewards(
    pressed: NDArray[np.bool_],
    key_state: NDArray[np.float64],
    wanted: NDArray[np.bool_],
    finger_key: NDArray[np.int8],
    tips: NDArray[np.float64],
    wrong: float,
) -> NDArray[np.float64]:
    """(B, 10) what each finger is rewarded for the keys as they are.

    Args:
        pressed: (B, 88) keys that sound.
        key_state: (B, 88) how far each is down.
        wanted: (B, 88) keys that should sound.
        finger_key: (B, 2, 5) the key that each finger was to press, -1 for none.
        tips: (B, 10, 3) where fingertips are [m].
        wrong: what a key costs that nobody wants.
    """
    own = finger_key.reshape(len(pressed), AGENTS).astype(np.int64)
    at = np.maximum(own, 0)
    down = np.take_along_axis(pressed, at, axis=1) + 0.2 * np.take_along_axis(key_state, at, axis=1)
    reward: NDArray[np.float64] = np.where(own >= 0, down / 1.2, 0.0)
    rows, keys = np.nonzero(pressed & ~wanted)
    away = np.linalg.norm((tips[rows] - key_centres()[keys, None])[..., 1:], axis=2)
    np.subtract.at(reward, (rows, away.argmin(axis=1)), wrong)
    return reward
