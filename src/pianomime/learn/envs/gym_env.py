"""The environment of Gymnasium, `gymnasium.make("pianomime.learn:pianomime/Song-v0", ...)`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_RATE
from pianomime.learn.envs.batch import SongBatch
from pianomime.learn.envs.config import EnvConfig, preset_env
from pianomime.learn.envs.observation import ObservationTerm, default_observation_terms
from pianomime.learn.envs.reference import load_demonstration
from pianomime.learn.envs.reward import RewardTerm, default_reward_terms
from pianomime.plan.demonstration import Demonstration
from pianomime.world.render import Painter
from pianomime.world.scene_look import key_colours

RENDER_SIZE = (960, 408)
"""Width and height of rendered frames [pixels]."""


def make_batch(
    demonstration: Demonstration | str | Path,
    config: EnvConfig | str,
    num_envs: int,
    threads: int = 0,
    extra_rewards: Sequence[RewardTerm] = (),
    extra_observations: Sequence[ObservationTerm] = (),
) -> SongBatch:
    """A batch from what the constructors of environments take.

    Args:
        demonstration: what is played: a demonstration or its file, a MIDI file, or the name of a
            bundled song.
        config: settings of the environment, or the name of a preset.
        num_envs: number of environments.
        threads: how many worlds step at the same time; 0 for one on each core.
        extra_rewards: terms that are added to those of the config.
        extra_observations: terms that follow those of the config.

    Raises:
        InputError: the song cannot be used, there is no such preset, or two terms have the same
            name.
    """
    if not isinstance(demonstration, Demonstration):
        demonstration = load_demonstration(demonstration)
    settings = preset_env(config) if isinstance(config, str) else config
    return SongBatch(
        demonstration,
        settings,
        num_envs,
        threads,
        (*default_reward_terms(settings.reward), *extra_rewards),
        (*default_observation_terms(settings.observation), *extra_observations),
    )


def observation_space(batch: SongBatch) -> spaces.Box:
    """The observation space of one environment."""
    return spaces.Box(-np.inf, np.inf, (batch.observer.size,), np.float32)


def action_space(batch: SongBatch) -> spaces.Box:
    """The action space of one environment."""
    return spaces.Box(-1.0, 1.0, (batch.action_size,), np.float32)


class SongEnv(gymnasium.Env[NDArray[Any], NDArray[Any]]):
    """One song, played by adding residuals to the controls of a base controller.

    An episode terminates with the song and is truncated after `episode.frames` frames. `info` has
    the frame that comes next (`frame`), the F1 of the episode so far (`f1`), the frames in which
    the physics broke (`blow_ups`) and what each reward term gave, times its weight
    (`reward/press`, `reward/mimic`, ...). `print` shows the table of terms.

    Args:
        demonstration: what is played: a demonstration or its file, a MIDI file, or the name of
            a bundled song.
        config: settings of the environment, or the name of a preset.
        render_mode: "rgb_array" for `render` to return pictures (408, 960, 3) uint8; needs OpenGL.
        extra_rewards: terms that are added to those of the config.
        extra_observations: terms that follow those of the config in the observation.

    Raises:
        InputError: the song cannot be used, there is no such preset or render mode, or two terms
            have the same name.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - Gymnasium declares it so
        "render_modes": ["rgb_array"],
        "render_fps": int(FRAME_RATE),
    }

    def __init__(
        self,
        demonstration: Demonstration | str | Path,
        config: EnvConfig | str = "paper",
        render_mode: str | None = None,
        extra_rewards: Sequence[RewardTerm] = (),
        extra_observations: Sequence[ObservationTerm] = (),
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(f"render_mode must be 'rgb_array' or None, not {render_mode!r}")
        self.render_mode = render_mode
        self._painter: Painter | None = None
        self.batch = make_batch(demonstration, config, 1, 1, extra_rewards, extra_observations)
        self.observation_space = observation_space(self.batch)
        self.action_space = action_space(self.batch)

    def __str__(self) -> str:
        """The environment's name, and the table of its terms."""
        return f"{type(self).__name__}\n{self.batch}"

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode; the seed decides where, if episodes begin anywhere."""
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
                **{f"reward/{name}": float(value[0]) for name, value in step.rewards.items()},
            },
        )

    def render(self) -> NDArray[np.uint8] | None:
        """The scene as it is, (408, 960, 3) uint8; None without a render mode.

        Raises:
            RenderUnavailable: there is no working OpenGL.
        """
        if self.render_mode is None:
            return None
        if self._painter is None:
            self._painter = Painter(*RENDER_SIZE)
        colours = key_colours(self.batch.pressed[0])
        return np.ascontiguousarray(self._painter.paint(self.batch.qpos[0], colours))

    def close(self) -> None:
        """Free what rendering holds."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None
