"""SongBatch: one song played in many worlds side by side, each step with a reward.

The environments of Gymnasium and Stable-Baselines3 are thin fronts of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.learn.envs.observation import Observer
from pianomime.learn.envs.reward import frame_reward
from pianomime.learn.expert.config import EnvConfig
from pianomime.plan.demonstration import Demonstration
from pianomime.track import BatchTracker, DynamicTracker, IkTracker
from pianomime.world import World, WorldBatch


def prior_tracker(config: EnvConfig) -> BatchTracker:
    """The tracker whose controls are improved."""
    return IkTracker() if config.prior == "ik" else DynamicTracker()


@dataclass(frozen=True, eq=False)
class Step:
    """What a step gave; B environments.

    Attributes:
        reward: (B,).
        terminated: (B,) bool, the song is over.
        truncated: (B,) bool, the episode is as long as it may be, but the song is not over.
        f1: (B,) frame-wise F1 of the episode so far.
        blow_ups: (B,) frames of the episode in which the physics broke.
    """

    reward: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    f1: NDArray[np.float64]
    blow_ups: NDArray[np.int64]


class SongBatch:
    """B environments of one song.

    Attributes:
        song: what is played.
        config: how.
        observer: tells where each part of an observation is.
        observations: (B, size) float32, of the present moment; written in place.
        frames: (B,) the frame that each plays next.

    Args:
        song: what is played.
        config: how.
        envs: B.
        threads: how many worlds step at the same time; 0 for one on each core.
    """

    def __init__(
        self, song: Demonstration, config: EnvConfig, envs: int = 1, threads: int = 0
    ) -> None:
        self.song, self.config = song, config
        self._plan, self._goal = song.plan, song.score.roll()
        self._pedal = song.score.pedal_roll()
        self._worlds = WorldBatch(envs, threads, quiet=True)
        self._tracker = prior_tracker(config)
        self._tracker.begin(self._plan)
        self.observer = Observer(config.observation, self._goal, self._plan)
        self._reach = config.action.factor * self.observer.ctrl_range
        self.actions = 46 + config.action.pedal
        self.observations = np.zeros((envs, self.observer.size), np.float32)
        self.frames = np.zeros(envs, np.int64)
        self._elapsed = np.zeros(envs, np.int64)
        self._f1_sum = np.zeros(envs)
        self._prior = np.zeros((envs, 46))
        self._starts: NDArray[np.float64] | None = None
        self._all = np.arange(envs)

    def __len__(self) -> int:
        """Number of environments."""
        return len(self.frames)

    def reset(self, draw: np.random.Generator, ids: NDArray[np.int64] | None = None) -> None:
        """Begin new episodes.

        Args:
            draw: says where they begin, if that is anywhere.
            ids: (n,) which environments; None for all.
        """
        which = self._all if ids is None else ids
        frames = np.zeros(len(which), np.int64)
        self._worlds.reset(ids=which)
        if self.config.episode.start == "anywhere":
            frames = draw.integers(0, len(self._plan), len(which))
            self._worlds.set_state(self._reference()[frames], which)
            self._worlds.pedal[which] = (frames > 0) & self._pedal[frames - 1]
        self.frames[which] = frames
        self._elapsed[which] = 0
        self._f1_sum[which] = 0.0
        self._look(which)

    def step(self, action: NDArray[np.floating[Any]]) -> Step:
        """Play one frame in every environment.

        Args:
            action: (B, actions) -1..1; what lies beyond counts as the end.

        Raises:
            ValueError: the song is over in an environment that was not reset.
        """
        if (self.frames == len(self._plan)).any():
            raise ValueError("the song is over in an environment: reset it first")
        action = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        frames = self.frames
        goal, wanted = self._goal[frames], self._pedal[frames]
        pedal = action[:, 46] > 0.0 if self.config.action.pedal else wanted
        self._worlds.step(self._prior + self._reach * action[:, :46], pedal)
        self.frames = frames + 1
        self._elapsed += 1
        tips = self._look(self._all)
        keys, pressed = self._worlds.key_state, self._worlds.pressed
        reward = frame_reward(
            self.config.reward,
            keys,
            pressed,
            goal,
            tips,
            self._plan.fingertips[frames, :, 1:],
            pedal == wanted,
        )
        hits = (pressed & goal).sum(axis=1)
        asked = pressed.sum(axis=1) + goal.sum(axis=1)
        self._f1_sum += np.where(asked, 2 * hits / np.maximum(asked, 1), 1.0)
        terminated = self.frames == len(self._plan)
        most = self.config.episode.frames
        truncated = (self._elapsed == most) & ~terminated if most else np.zeros(len(self), bool)
        return Step(
            reward,
            terminated,
            truncated,
            self._f1_sum / self._elapsed,
            self._worlds.blow_ups.copy(),
        )

    def state(self) -> dict[str, NDArray[Any]]:
        """The present moment of all environments, for `set_state`."""
        return {
            "worlds": self._worlds.state(),
            "pedal": self._worlds.pedal.copy(),
            "blow_ups": self._worlds.blow_ups.copy(),
            "frames": self.frames.copy(),
            "elapsed": self._elapsed.copy(),
            "f1_sum": self._f1_sum.copy(),
        }

    def set_state(self, state: dict[str, NDArray[Any]]) -> None:
        """Go to a moment that `state` gave; what follows is the same each time, bit for bit."""
        self._worlds.set_state(state["worlds"])
        self._worlds.pedal[:] = state["pedal"]
        self._worlds.blow_ups[:] = state["blow_ups"]
        self.frames = state["frames"].copy()
        self._elapsed = state["elapsed"].copy()
        self._f1_sum = state["f1_sum"].copy()
        self._look(self._all)

    def _look(self, which: NDArray[np.int64]) -> NDArray[np.float64]:
        """Ask the prior, and write observations; the fingertips (n, 2, 5, 3) [m]."""
        frames = self.frames[which]
        last = np.minimum(frames, len(self._plan) - 1)
        prior, points = self._tracker.controls(last, self._worlds.qpos[which])
        tips = points[:, :, 1:]
        self._prior[which] = prior
        self.observer.write(
            self.observations,
            which,
            frames,
            self._worlds.qpos_hands[which],
            self._worlds.qvel_hands[which],
            self._worlds.key_state[which],
            tips,
            prior,
            self._worlds.pedal[which],
        )
        return tips

    def _reference(self) -> NDArray[np.float64]:
        """(T, S) states in which the prior alone has the world before each frame."""
        if self._starts is None:
            world, tracker = World(quiet=True), prior_tracker(self.config)
            tracker.begin(self._plan)
            starts = []
            for frame in range(len(self._plan)):
                starts.append(world.state())
                world.step(tracker.control(frame, world), bool(self._pedal[frame]))
            self._starts = np.array(starts)
        return self._starts
