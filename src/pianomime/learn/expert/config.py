"""Everything that decides how an expert is made: typed, saved with it, and the command line.

Cheap to import: no numpy, no torch.
"""

from __future__ import annotations

import dataclasses
import typing
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

from pianomime.errors import InputError


@dataclass(frozen=True)
class ObservationConfig:
    """Which parts an observation has (paper, table 4); their order is that of the fields."""

    joints: bool = True
    """54 hand and forearm joint positions."""
    velocities: bool = True
    """54 hand and forearm joint velocities."""
    keys: bool = True
    """88 key positions."""
    goal: int = 1
    """Frames of goals (88 keys each), the present one and those ahead."""
    fingertips: int = 1
    """Frames of the plan's fingertip targets (36 each), the present one and those ahead."""
    prior: bool = True
    """46 controls that the prior proposes."""
    pedal: bool = True
    """Whether the pedal is down."""
    errors: bool = False
    """30 distances from the fingertips to their targets."""
    time: bool = False
    """How much of the song is over."""


@dataclass(frozen=True)
class ActionConfig:
    """What a policy adds to the prior (paper, table 5)."""

    factor: float = 0.03
    """Largest residual, as a share of each actuator's range."""
    pedal: bool = False
    """The policy works the pedal, with one more action; the score does if not."""


@dataclass(frozen=True)
class RewardConfig:
    """Weights of the reward (paper, table 3)."""

    press: float = 2 / 3
    """Of the right keys down, and only those."""
    mimic: float = 1 / 3
    """Of fingertips where the plan has them."""
    pedal: float = 0.0
    """Of the pedal as the score has it."""
    hit: float = 0.5
    """Share of `press` that keys which are due have; the rest is lost by any other that is down."""


@dataclass(frozen=True)
class EpisodeConfig:
    """Where episodes begin and end."""

    start: Literal["beginning", "anywhere"] = "beginning"
    """At the song's beginning, or at any frame, in the state that the prior alone has there."""
    frames: int = 0
    """Longest episode; 0 for up to the end of the song."""


@dataclass(frozen=True)
class EnvConfig:
    """The environment."""

    prior: Literal["ik", "dynamic"] = "ik"
    """The tracker whose controls are improved: the paper's, or the zero-shot player's."""
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    action: ActionConfig = field(default_factory=ActionConfig)
    reward: RewardConfig = field(default_factory=RewardConfig)
    episode: EpisodeConfig = field(default_factory=EpisodeConfig)


@dataclass(frozen=True)
class PpoConfig:
    """Proximal policy optimisation (paper, table 6)."""

    envs: int = 16
    """Songs played side by side."""
    steps_per_update: int = 8192
    """Control steps, in all environments together, between updates."""
    batch: int = 1024
    """Steps in a minibatch."""
    epochs: int = 10
    """Passes over the steps of an update."""
    learning_rate: float = 3e-4
    """At the start."""
    decay: float = 0.999
    """Of the learning rate, from update to update."""
    hidden: tuple[int, ...] = (1024, 256)
    """Width of each hidden layer, of the actor and of the critic."""
    activation: Literal["gelu", "relu", "tanh"] = "gelu"
    """Between layers."""
    discount: float = 0.99
    """Of rewards, from step to step."""
    gae: float = 0.95
    """Lambda of the generalised advantage estimate."""
    clip: float = 0.2
    """Range of the likelihood ratio."""
    entropy: float = 0.0
    """Coefficient."""
    value: float = 0.5
    """Coefficient of the critic's loss."""
    gradient_norm: float = 0.5
    """Largest."""
    target_kl: float = 0.0
    """Divergence that ends the passes of an update early; 0 for none."""
    noise: float = 0.3
    """Standard deviation of actions at the start; table 6 does not tell it."""
    evaluate_every: int = 1
    """Updates between evaluations."""


@dataclass(frozen=True)
class TrajectorySearchConfig:
    """Improving a song's controls by trying variations of them in simulation, pass after pass."""

    variations: int = 32
    """Variations that are rolled out side by side."""
    rounds: int = 2
    """Times that variations of the best so far are drawn."""
    commit: int = 4
    """Frames that are settled before looking ahead again."""
    ahead: int = 12
    """Frames that are looked ahead."""
    sizes: tuple[float, ...] = (1.0, 1.5, 0.5)
    """Size of the variations of the passes, in turn, as a factor of `RolloutConfig`'s."""


@dataclass(frozen=True)
class ExpertConfig:
    """How an expert is made."""

    method: Literal["ppo", "search"] = "ppo"
    """A residual policy, or controls found by search."""
    steps: int = 1_000_000
    """Control steps of simulation to spend."""
    seed: int = 0
    """Of everything that is drawn; the same seed gives the same expert."""
    env: EnvConfig = field(default_factory=EnvConfig)
    ppo: PpoConfig = field(default_factory=PpoConfig)
    search: TrajectorySearchConfig = field(default_factory=TrajectorySearchConfig)


_PAPER = ExpertConfig()
"""Appendices C and D. Table 6 has 2000 updates of 8192 steps; the default spends fewer."""

_BEST = ExpertConfig(method="search", env=EnvConfig(prior="dynamic"))
"""What plays best in a quarter of an hour on two cores."""

PRESETS = {"paper": _PAPER, "best": _BEST}


def preset_config(name: str) -> ExpertConfig:
    """A config by its name.

    Raises:
        InputError: there is no such preset.
    """
    if name not in PRESETS:
        raise InputError(f"there is no preset {name!r}; there are: {', '.join(PRESETS)}")
    return PRESETS[name]


def to_json(config: ExpertConfig) -> dict[str, Any]:
    """The config as JSON has it."""
    return dataclasses.asdict(config)


_T = TypeVar("_T")


def from_json(kind: type[_T], content: Any) -> _T:
    """The config that `to_json` gave.

    Raises:
        InputError: a field is missing, unknown or of another type.
    """
    if not isinstance(content, dict):
        raise InputError(f"{kind.__name__} must be an object, not {content!r}")
    hints = typing.get_type_hints(kind)
    if set(content) != set(hints):
        odd = ", ".join(sorted(set(content) ^ set(hints)))
        raise InputError(f"{kind.__name__} has other fields than this program's: {odd}")
    return kind(**{name: _value(name, hints[name], value) for name, value in content.items()})


def differences(there: dict[str, Any], now: dict[str, Any], within: str = "") -> list[str]:
    """What two configs, as JSON has them, differ in: "name: value there, value now"."""
    found: list[str] = []
    for name in {**there, **now}:
        one, other = there.get(name), now.get(name)
        if isinstance(one, dict) and isinstance(other, dict):
            found += differences(one, other, f"{within}{name}.")
        elif one != other:
            found.append(f"{within}{name}: {one} there, {other} now")
    return found


def _value(name: str, hint: Any, value: Any) -> Any:
    if dataclasses.is_dataclass(hint):
        return from_json(typing.cast(type[Any], hint), value)
    origin = typing.get_origin(hint)
    if origin is tuple and isinstance(value, list):
        return tuple(_value(name, typing.get_args(hint)[0], one) for one in value)
    if origin is Literal:
        right = value in typing.get_args(hint)
    elif hint is float:
        right = isinstance(value, int | float) and not isinstance(value, bool)
    else:
        right = type(value) is hint
    if not right:
        raise InputError(f"{name} cannot be {value!r}")
    return value
