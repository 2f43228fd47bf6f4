"""Worlds that play many songs, one after the other, for Stable-Baselines3."""

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
from pianomime.world import WorldBatch


class Song(Protocol):
    """What is played: `goal` (T, 88) bool and `pedal` (T,) bool."""

    @property
    def goal(self) -> NDArray[np.bool_]:
        """(T, 88) keys that should be down."""
        ...

    @property
    def pedal(self) -> NDArray[np.bool_]:
        """(T,) whether the pedal should be."""
        ...


@dataclass(frozen=True, eq=False)
class Played:
    """A frame that was played in all worlds, W of them.

    Attributes:
        rows: (W, 2) song and frame of each.
        wanted: (W, 88) keys that should have been down.
        pressed: (W, 88) keys that sound.
        key_state: (W, 88) how far each is down.
    """

    rows: NDArray[np.int64]
    wanted: NDArray[np.bool_]
    pressed: NDArray[np.bool_]
    key_state: NDArray[np.float64]


class Sb3MultiSongEnv(Sb3BaseEnv):
    """Worlds, each with a song by chance, and another one when it is over.

    Attributes:
        worlds: where they are played.
        rows: (W, 2) the song that each world plays, and the frame that comes next.

    Args:
        songs: what is played.
        worlds: how many at a time.
        agents: environments in each world, which have equal shares of what is seen and done.
        observations: numbers that each is told.
        actions: numbers that each says, -1..1.
        threads: how many worlds step at the same time; 0 for one on each core.
    """

    def __init__(
        self,
        songs: Sequence[Song],
        worlds: int,
        agents: int,
        observations: int,
        actions: int,
        threads: int = 0,
    ) -> None:
        self._songs, self._agents = songs, agents
        self.worlds = WorldBatch(worlds, threads, quiet=True)
        self.rows = np.zeros((worlds, 2), np.int64)
        super().__init__(
            worlds * agents,
            gymnasium.spaces.Box(-np.inf, np.inf, (observations,), np.float32),
            gymnasium.spaces.Box(-1.0, 1.0, (actions,), np.float32),
        )

    @abstractmethod
    def see(self) -> NDArray[np.float32]:
        """(W, agents, observations) of the present moment."""

    @abstractmethod
    def controls(self, said: NDArray[Any]) -> NDArray[np.float64]:
        """(W, 46) controls of what is said (W, agents, actions)."""

    @abstractmethod
    def rewards(self, played: Played, said: NDArray[Any]) -> NDArray[np.float64]:
        """(W, agents) of a frame that was played; worlds whose song is over are at rest already."""

    def begin(self) -> None:
        """Begin a song in every world."""
        self._begin(np.arange(len(self.worlds)))

    def look(self) -> NDArray[np.float32]:
        """The observations of the present moment."""
        return self.see().reshape(self.num_envs, -1)

    def play(self, actions: NDArray[Any]) -> VecEnvStepReturn:
        """Play one frame in every world."""
        said = np.clip(actions, -1.0, 1.0).reshape(len(self.worlds), self._agents, -1)
        rows = self.rows.copy()
        songs = [self._songs[number] for number in rows[:, 0]]
        pairs = list(zip(songs, rows[:, 1].tolist(), strict=True))
        self.worlds.step(self.controls(said), [bool(song.pedal[at]) for song, at in pairs])
        played = Played(
            rows,
            np.array([song.goal[at] for song, at in pairs]),
            self.worlds.pressed,
            self.worlds.key_state,
        )
        self.rows[:, 1] += 1
        over = self.rows[:, 1] == [len(song.goal) for song in songs]
        self._begin(np.flatnonzero(over))
        told = self.look()
        reward = np.where(over[:, None], 0.0, self.rewards(played, said))
        done = np.repeat(over, self._agents)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(done):
            infos[row]["terminal_observation"] = told[row]
        return told, reward.reshape(-1).astype(np.float32), done, infos

    def state(self) -> Arrays:
        """The present moment of all worlds, for `set_state`."""
        pedal = self.worlds.pedal.copy()
        return {"worlds": self.worlds.state(), "pedal": pedal, "rows": self.rows.copy()}

    def set_state(self, state: Arrays) -> None:
        """Go to a moment that `state` gave; what follows is the same each time."""
        self.worlds.set_state(state["worlds"])
        self.worlds.pedal[:] = state["pedal"]
        self.rows = state["rows"].copy()
        self.look()

    def _begin(self, which: NDArray[np.int64]) -> None:
        if len(which):
            self.worlds.reset(ids=which)
            self.rows[which, 0] = self.draw.integers(0, len(self._songs), len(which))
            self.rows[which, 1] = 0
