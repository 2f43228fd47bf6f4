"""Worlds that play many songs, one after the other, as an environment of Stable-Baselines3."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from pianomime.learn.envs.sb3_base import Sb3BaseEnv
from pianomime.learn.runs.safetensors_file import Arrays
from pianomime.short_repr import short_repr
from pianomime.world import WorldBatch


class SongGoals(Protocol):
    """What is played, frame by frame."""

    @property
    def goal(self) -> NDArray[np.bool_]:
        """(T, 88) bool, the keys that should sound."""
        ...

    @property
    def pedal(self) -> NDArray[np.bool_]:
        """(T,) bool, whether the pedal should be down."""
        ...


@dataclass(frozen=True, eq=False)
class PlayedFrame:
    """A frame that was played in W worlds.

    Attributes:
        rows: (W, 2) number of the song and frame in each world.
        goal: (W, 88) bool, the keys that should sound.
        pressed: (W, 88) bool, the keys that sound.
        key_state: (W, 88) how far each key is down, 0..1.
    """

    rows: NDArray[np.int64]
    goal: NDArray[np.bool_]
    pressed: NDArray[np.bool_]
    key_state: NDArray[np.float64]

    __repr__ = short_repr


class Sb3MultiSongEnv(Sb3BaseEnv):
    """W worlds, each of which plays one random song after the other.

    Attributes:
        worlds: the worlds.
        rows: (W, 2) number of the song that each world plays, and the frame that comes next.

    Args:
        songs: what is played.
        num_worlds: number of worlds, W.
        agents: environments in each world, which divide its observation and action equally.
        observation_size: numbers in the observation of an agent.
        action_size: numbers in the action of an agent.
        threads: how many worlds step at the same time; 0 for one on each core.
    """

    def __init__(
        self,
        songs: Sequence[SongGoals],
        num_worlds: int,
        agents: int,
        observation_size: int,
        action_size: int,
        threads: int = 0,
    ) -> None:
        self._songs, self._agents = songs, agents
        self.worlds = WorldBatch(num_worlds, threads, quiet=True)
        self.rows = np.zeros((num_worlds, 2), np.int64)
        super().__init__(
            num_worlds * agents,
            gymnasium.spaces.Box(-np.inf, np.inf, (observation_size,), np.float32),
            gymnasium.spaces.Box(-1.0, 1.0, (action_size,), np.float32),
        )

    @abstractmethod
    def agent_observations(self) -> NDArray[np.float32]:
        """(W, agents, observation_size) the present observations."""

    @abstractmethod
    def controls(self, actions: NDArray[Any]) -> NDArray[np.float64]:
        """(W, 46) controls [rad, m].

        Args:
            actions: (W, agents, action_size) -1..1.
        """

    @abstractmethod
    def rewards(self, played: PlayedFrame, actions: NDArray[Any]) -> NDArray[np.float64]:
        """(W, agents) the rewards of a frame.

        Worlds whose song is over have begun the next one already; their rewards are not used.

        Args:
            played: the frame.
            actions: (W, agents, action_size) -1..1.
        """

    def begin_episodes(self) -> None:
        """Begin a song in every world."""
        self._begin(np.arange(len(self.worlds)))

    def observations(self) -> NDArray[np.float32]:
        """(W * agents, observation_size) the present observations."""
        return self.agent_observations().reshape(self.num_envs, -1)

    def step_frame(self, actions: NDArray[Any]) -> VecEnvStepReturn:
        """Play one frame in every world."""
        by_agent = np.clip(actions, -1.0, 1.0).reshape(len(self.worlds), self._agents, -1)
        rows = self.rows.copy()
        songs = [self._songs[number] for number in rows[:, 0]]
        pairs = list(zip(songs, rows[:, 1].tolist(), strict=True))
        self.worlds.step(self.controls(by_agent), [bool(song.pedal[at]) for song, at in pairs])
        played = PlayedFrame(
            rows,
            np.array([song.goal[at] for song, at in pairs]),
            self.worlds.pressed,
            self.worlds.key_state,
        )
        self.rows[:, 1] += 1
        over = self.rows[:, 1] == [len(song.goal) for song in songs]
        self._begin(np.flatnonzero(over))
        observations = self.observations()
        reward = np.where(over[:, None], 0.0, self.rewards(played, by_agent))
        done = np.repeat(over, self._agents)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(done):
            infos[row]["terminal_observation"] = observations[row]
        return observations, reward.reshape(-1).astype(np.float32), done, infos

    def state(self) -> Arrays:
        """The state of all worlds, for `set_state`."""
        pedal = self.worlds.pedal.copy()
        return {"worlds": self.worlds.state(), "pedal": pedal, "rows": self.rows.copy()}

    def set_state(self, state: Arrays) -> None:
        """Go to a state that `state` gave; what follows is the same each time."""
        self.worlds.set_state(state["worlds"])
        self.worlds.pedal[:] = state["pedal"]
        self.rows = state["rows"].copy()
        self.observations()

    def _begin(self, which: NDArray[np.int64]) -> None:
        if len(which):
            self.worlds.reset(ids=which)
            self.rows[which, 0] = self.rng.integers(0, len(self._songs), len(which))
            self.rows[which, 1] = 0
