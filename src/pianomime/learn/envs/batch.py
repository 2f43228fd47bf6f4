"""SongBatch: one song played in many worlds side by side, each step with a reward.

The environments of Gymnasium and Stable-Baselines3 are thin wrappers of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.learn.envs.config import EnvConfig
from pianomime.learn.envs.observation import (
    ObservationTerm,
    Observer,
    control_range,
    default_observation_terms,
)
from pianomime.learn.envs.reference import Reference
from pianomime.learn.envs.reward import (
    RewardTerm,
    check_reward_terms,
    default_reward_terms,
    weighted_rewards,
)
from pianomime.learn.envs.state import EnvState
from pianomime.plan import FingertipPlan
from pianomime.plan.demonstration import Demonstration
from pianomime.players.rollout import rollout
from pianomime.short_repr import short_repr
from pianomime.track import BatchController, BatchTracker, DynamicTracker, IkTracker
from pianomime.validation import within
from pianomime.world import World
from pianomime.world.device_batch import device_batch
from pianomime.world.layout import LAYOUT


def base_tracker(config: EnvConfig) -> BatchTracker:
    """The tracker that makes the base controller of a config."""
    return IkTracker() if config.base == "ik" else DynamicTracker(world=config.world)


def base_controller(config: EnvConfig, plan: FingertipPlan) -> BatchController:
    """The controller to whose controls residuals are added.

    Args:
        config: says which one.
        plan: what it follows.
    """
    return base_tracker(config).start(plan)


@dataclass(frozen=True, eq=False)
class Step:
    """What a control step gave, in B environments.

    Attributes:
        reward: (B,) the sum of `rewards`.
        rewards: (B,) of each reward term by name, times its weight.
        terminated: (B,) bool, the song is over.
        truncated: (B,) bool, the episode has its full length, but the song is not over.
        f1: (B,) frame-wise F1 of the episode so far.
        blow_ups: (B,) frames of the episode in which the physics broke.
    """

    reward: NDArray[np.float64]
    rewards: dict[str, NDArray[np.float64]]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    f1: NDArray[np.float64]
    blow_ups: NDArray[np.int64]

    __repr__ = short_repr


class SongBatch:
    """B environments of one song.

    `print` shows a table of the terms of the observation and of the reward.

    Attributes:
        demonstration: what is played.
        config: settings of the environment.
        reward_terms: terms of the reward, in the order in which they are added.
        observer: terms of the observation, and where each is in it.
        action_size: numbers in an action: a residual for each actuator, and the pedal if the
            policy works it.
        observations: (B, size) float32, the present observations; written in place.
        frames: (B,) the frame that each environment plays next.

    Args:
        demonstration: what is played.
        config: settings of the environment.
        num_envs: number of environments, B.
        threads: how many worlds step at the same time; 0 for one on each core.
        reward_terms: the config's if None.
        observation_terms: the config's if None.

    Raises:
        InputError: two terms have the same name, the config's device cannot be used here, or a
            number is out of range.
    """

    def __init__(
        self,
        demonstration: Demonstration,
        config: EnvConfig,
        num_envs: int = 1,
        threads: int = 0,
        reward_terms: Sequence[RewardTerm] | None = None,
        observation_terms: Sequence[ObservationTerm] | None = None,
    ) -> None:
        within("num_envs", num_envs, 1)
        within("threads", threads, 0)
        self.demonstration, self.config = demonstration, config
        self._reference = Reference.of(demonstration)
        self._worlds = device_batch(
            num_envs, config.device, threads, quiet=True, model=config.world
        )
        self._base = base_controller(config, demonstration.plan)
        self.reward_terms = check_reward_terms(
            default_reward_terms(config.reward) if reward_terms is None else reward_terms
        )
        self.observer = Observer(
            default_observation_terms(config.observation)
            if observation_terms is None
            else observation_terms
        )
        self._residual_range = config.action.factor * control_range()
        self.action_size = LAYOUT.ctrl_size + config.action.pedal
        self.observations = np.zeros((num_envs, self.observer.size), np.float32)
        self.frames = np.zeros(num_envs, np.int64)
        self._elapsed = np.zeros(num_envs, np.int64)
        self._f1_sum = np.zeros(num_envs)
        self._base_control = np.zeros((num_envs, LAYOUT.ctrl_size))
        self._action = np.zeros((num_envs, self.action_size))
        self._start_states: NDArray[np.float64] | None = None
        self._all = np.arange(num_envs)

    def __len__(self) -> int:
        """Number of environments, B."""
        return len(self.frames)

    def __str__(self) -> str:
        """The terms of the observation and of the reward, as tables."""
        title = self.demonstration.score.title
        factor = self.config.action.factor
        pedal = ", and the pedal" if self.config.action.pedal else ""
        observations = [
            (term.name, str(term.size), term.unit, term.scaling) for term in self.observer.terms
        ]
        rewards = [(term.name, f"{term.weight:.4g}") for term in self.reward_terms]
        return "\n".join(
            [
                f"{title}: {len(self._reference)} frames, {len(self)} environments, "
                f"base controller {self.config.base}",
                "",
                f"action: {self.action_size} numbers, residuals of at most {factor:g} of each "
                f"control range{pedal}",
                "",
                f"observation: {self.observer.size} numbers",
                *_table(("term", "size", "unit", "scaling"), observations),
                "",
                "reward",
                *_table(("term", "weight"), rewards),
            ]
        )

    @property
    def qpos(self) -> NDArray[np.float64]:
        """(B, 142) positions: 88 keys, right hand 27, left hand 27 [rad, m]; a copy."""
        return self._worlds.qpos

    @property
    def key_state(self) -> NDArray[np.float64]:
        """(B, 88) how far each key is down, 0..1."""
        return self._worlds.key_state

    @property
    def pressed(self) -> NDArray[np.bool_]:
        """(B, 88) bool, the keys that sound."""
        return self._worlds.pressed

    def reset(self, rng: np.random.Generator, ids: NDArray[np.int64] | None = None) -> None:
        """Begin new episodes.

        Args:
            rng: draws the first frames if episodes begin anywhere.
            ids: (n,) which environments; None for all.
        """
        which = self._all if ids is None else ids
        frames = np.zeros(len(which), np.int64)
        self._worlds.reset(ids=which)
        if self.config.episode.start == "anywhere":
            frames = rng.integers(0, len(self._reference), len(which))
            self._worlds.set_state(self._states_of_base()[frames], which)
            self._worlds.pedal[which] = (frames > 0) & self._reference.pedal[frames - 1]
        self.frames[which] = frames
        self._elapsed[which] = 0
        self._f1_sum[which] = 0.0
        self._action[which] = 0.0
        self._observe(which)

    def step(self, action: NDArray[np.floating[Any]]) -> Step:
        """Play one frame in every environment.

        Args:
            action: (B, action_size); clipped to -1..1.

        Raises:
            ValueError: the song is over in an environment that was not reset.
        """
        if (self.frames == len(self._reference)).any():
            raise ValueError("the song is over in an environment: reset it first")
        self._action = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        residual = self._action[:, : LAYOUT.ctrl_size]
        frames = self.frames
        pedal = self._reference.pedal[frames]
        if self.config.action.pedal:
            pedal = self._action[:, LAYOUT.ctrl_size] > 0.0
        self._worlds.step(self._base_control + self._residual_range * residual, pedal)
        self.frames = frames + 1
        self._elapsed += 1
        played = replace(self._observe(self._all), frames=frames)
        rewards = weighted_rewards(self.reward_terms, played)
        reward = np.zeros(len(self))
        for value in rewards.values():
            reward = reward + value
        hits = (played.pressed & played.goal).sum(axis=1)
        asked = played.pressed.sum(axis=1) + played.goal.sum(axis=1)
        self._f1_sum += np.where(asked, 2 * hits / np.maximum(asked, 1), 1.0)
        terminated = self.frames == len(self._reference)
        most = self.config.episode.frames
        truncated = (self._elapsed == most) & ~terminated if most else np.zeros(len(self), bool)
        return Step(
            reward,
            rewards,
            terminated,
            truncated,
            self._f1_sum / self._elapsed,
            self._worlds.blow_ups.copy(),
        )

    def state(self) -> dict[str, NDArray[Any]]:
        """The state of all environments, for `set_state`."""
        return {
            "worlds": self._worlds.state(),
            "pedal": self._worlds.pedal.copy(),
            "blow_ups": self._worlds.blow_ups.copy(),
            "frames": self.frames.copy(),
            "elapsed": self._elapsed.copy(),
            "f1_sum": self._f1_sum.copy(),
            "action": self._action.copy(),
        }

    def set_state(self, state: dict[str, NDArray[Any]]) -> None:
        """Go to a state that `state` gave; what follows is the same each time, bit for bit."""
        self._worlds.set_state(state["worlds"])
        self._worlds.pedal[:] = state["pedal"]
        self._worlds.blow_ups[:] = state["blow_ups"]
        self.frames = state["frames"].copy()
        self._elapsed = state["elapsed"].copy()
        self._f1_sum = state["f1_sum"].copy()
        self._action = state["action"].copy()
        self._observe(self._all)

    def _observe(self, which: NDArray[np.int64]) -> EnvState:
        """Ask the base controller for the next frame, write the observations; their state."""
        frames = self.frames[which]
        last = np.minimum(frames, len(self._reference) - 1)
        base_control, points = self._base.controls(last, self._worlds.qpos[which])
        self._base_control[which] = base_control
        state = EnvState(
            reference=self._reference,
            frames=frames,
            joints=self._worlds.qpos_hands[which],
            velocities=self._worlds.qvel_hands[which],
            key_state=self._worlds.key_state[which],
            pressed=self._worlds.pressed[which],
            tips=points[:, :, 1:],
            pedal=self._worlds.pedal[which],
            base_control=base_control,
            action=self._action[which],
        )
        self.observer.write(self.observations, which, state)
        return state

    def _states_of_base(self) -> NDArray[np.float64]:
        """(T, S) states of the world before each frame when the base controller plays alone."""
        if self._start_states is None:
            world = World(self.config.world, quiet=True)
            base = base_controller(self.config, self._reference.plan)
            states = [world.state()]
            states += [world.state() for _ in rollout(base, world, self._reference.pedal)]
            self._start_states = np.array(states[:-1])
        return self._start_states


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table whose columns are aligned."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    return [
        "  " + "  ".join(cell.ljust(wide) for cell, wide in zip(row, widths, strict=True)).rstrip()
        for row in (head, *rows)
    ]
