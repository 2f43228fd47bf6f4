"""The environment of Gymnasium, `gymnasium.make("pianomime/Song-v0", demonstration=...)`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from pianomime.learn.envs.batch import SongBatch
from pianomime.learn.envs.reference import load_song
from pianomime.learn.expert.config import EnvConfig, preset_config
from pianomime.learn.runs.validation import check_env
from pianomime.plan.demonstration import Demonstration


def make_batch(
    demonstration: Demonstration | str | Path,
    config: EnvConfig | str,
    envs: int,
    threads: int = 0,
) -> SongBatch:
    """A batch of what a caller named: a song or its file, a config or the name of a preset.

    Raises:
        InputError: one of them cannot be used.
    """
    song = demonstration if isinstance(demonstration, Demonstration) else load_song(demonstration)
    chosen = preset_config(config).env if isinstance(config, str) else config
    check_env(chosen)
    return SongBatch(song, chosen, envs, threads)


def observation_space(batch: SongBatch) -> spaces.Box:
    """Of one environment."""
    return spaces.Box(-np.inf, np.inf, (batch.observer.size,), np.float32)


def action_space(batch: SongBatch) -> spaces.Box:
    """Of one environment."""
    return spaces.Box(-1.0, 1.0, (batch.actions,), np.float32)


class SongEnv(gymnasium.Env[NDArray[Any], NDArray[Any]]):
    """One song, played by adding residuals to what a tracker proposes.

    An episode terminates with the song and is truncated at the longest length of an episode.
    `info` holds the frame that comes next, the F1 of the episode so far and its blow-ups.

    Args:
        demonstration: what is played: a demonstration or its file, a MIDI file, or the name of
            a bundled song.
        config: the environment's config, or the name of a preset.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - so it is in Gymnasium

    def __init__(
        self, demonstration: Demonstration | str | Path, config: EnvConfig | str = "paper"
    ) -> None:
        self.batch = make_batch(demonstration, config, 1, threads=1)
        self.observation_space = observation_space(self.batch)
        self.action_space = action_space(self.batch)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode; the seed says where, if that is anywhere."""
        super().reset(seed=seed)
        self.batch.reset(self.np_random)
        return self.batch.observations[0].copy(), {"frame": int(self.batch.frames[0])}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Play one frame."""
        step = self.batch.step(np.asarray(action)[None])
        return (
            self.batch.observations[0].copy(),
            float(step.reward[0]),
            bool(step.terminated[0]),
            bool(step.truncated[0]),
            {
                "frame": int(self.batch.frames[0]),
                "f1": float(step.f1[0]),
                "blow_ups": int(step.blow_ups[0]),
            },
        )
