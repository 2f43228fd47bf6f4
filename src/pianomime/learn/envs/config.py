"""Settings of the environment of one song. Cheap to import: no numpy, no torch.

Every config checks itself when it is made and raises an `InputError` that names the setting as the
command line does, such as `env.reward.press`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from pianomime.device_names import CPU, DEVICES, DeviceName
from pianomime.errors import InputError, unknown_name
from pianomime.learn.runs.config_json import ADDED
from pianomime.validation import one_of, whole_numbers, within
from pianomime.world_names import PAPER, WORLDS, WorldName

_MOST_AHEAD = 200
"""Frames ahead that a policy may observe, ten seconds."""


@dataclass(frozen=True)
class ObservationConfig:
    """Terms of the observation (paper, table 4), in the order in which they are concatenated."""

    joints: bool = True
    """Positions of the 54 joints of both hands and forearms."""
    velocities: bool = True
    """Velocities of the 54 joints of both hands and forearms."""
    keys: bool = True
    """Positions of the 88 keys."""
    goal: int = 1
    """Number of goal frames (88 keys each): the next frame and those after it."""
    fingertips: int = 1
    """Number of frames of the plan's targets (36 numbers each): the next and those after it."""
    base_control: bool = True
    """The 46 controls that the base controller proposes for the next frame."""
    pedal: bool = True
    """Whether the sustain pedal is down."""
    errors: bool = False
    """Vectors from the ten fingertips to their targets (30 numbers)."""
    time: bool = False
    """Share of the song that has been played."""

    def __post_init__(self) -> None:
        whole_numbers(self, "env.observation")
        within("env.observation.goal", self.goal, 0, _MOST_AHEAD)
        within("env.observation.fingertips", self.fingertips, 0, _MOST_AHEAD)
        if not any(vars(self).values()):
            raise InputError("env.observation: a policy needs at least one observation term")


@dataclass(frozen=True)
class ActionConfig:
    """What a policy adds to the base controller (paper, table 5)."""

    factor: float = 0.03
    """Largest residual, as a share of each actuator's control range."""
    pedal: bool = False
    """Let the policy work the pedal with one more action; otherwise the score's pedal is used."""

    def __post_init__(self) -> None:
        within("env.action.factor", self.factor, 0, 1)


@dataclass(frozen=True)
class RewardConfig:
    """Weights of the reward terms (paper, table 3)."""

    press: float = 2 / 3
    """Weight of the term for pressing the goal keys and no others."""
    mimic: float = 1 / 3
    """Weight of the term for fingertips close to the plan's targets."""
    pedal: float = 0.0
    """Weight of the term for the pedal being as in the score."""
    hit: float = 0.5
    """Share of the press term that is given for goal keys; the rest is for no wrong key."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            within(f"env.reward.{name}", value, 0)
        within("env.reward.hit", self.hit, 0, 1)


@dataclass(frozen=True)
class EpisodeConfig:
    """Where episodes begin and end."""

    start: Literal["beginning", "anywhere"] = "beginning"
    """Begin with the song, or at a random frame in the state that the base controller has there."""
    frames: int = 0
    """Frames after which an episode is truncated; 0 for never."""

    def __post_init__(self) -> None:
        whole_numbers(self, "env.episode")
        one_of("env.episode.start", self.start, ("beginning", "anywhere"))
        within("env.episode.frames", self.frames, 0)


@dataclass(frozen=True)
class EnvConfig:
    """The environment: world, base controller, observation, action, reward, episode."""

    world: WorldName = field(default=PAPER, metadata={ADDED: True})
    """The world in which it is played: the paper's, or one in which hands are solid and what moves
    them has limits."""
    device: DeviceName = field(default=CPU, metadata={ADDED: True})
    """What steps the worlds: the cores, or a GPU of NVIDIA (the extra gpu)."""
    base: Literal["ik", "dynamic"] = "ik"
    """Base controller that the residual is added to: the paper's inverse kinematics, or the
    dynamic tracker of `zero-shot-20hz`."""
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    action: ActionConfig = field(default_factory=ActionConfig)
    reward: RewardConfig = field(default_factory=RewardConfig)
    episode: EpisodeConfig = field(default_factory=EpisodeConfig)

    def __post_init__(self) -> None:
        one_of("env.world", self.world, WORLDS)
        one_of("env.device", self.device, DEVICES)
        one_of("env.base", self.base, ("ik", "dynamic"))


ENV_PRESETS = {"paper": EnvConfig(), "best": EnvConfig(base="dynamic")}
"""The environments of the presets of experts, by name."""


def preset_env(name: str) -> EnvConfig:
    """The environment of a preset.

    Raises:
        InputError: there is no preset of that name.
    """
    if name not in ENV_PRESETS:
        raise unknown_name("preset", name, ENV_PRESETS)
    return ENV_PRESETS[name]
