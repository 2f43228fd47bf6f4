"""A learned policy as it is played: an ONNX network with its metadata, run without torch."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.policies.features import Observation, action_reference
from pianomime.policies.horizon import CHUNK, MOST_DIFFUSION_STEPS
from pianomime.policies.sampler import Sampler, ddim_sample
from pianomime.sealed_json import parse_json
from pianomime.short_repr import short_repr

FORMAT = "pianomime policy"
VERSION = 2
METADATA = "pianomime"
"""Name of the ONNX metadata property that holds a `PolicyInfo` as JSON."""

_MOST_NUMBERS = 1000
"""Numbers of an action at most, of any level."""
_NORMALIZER_RANGE = {"median": (-100.0, 100.0), "unit": (1e-6, 100.0), "limit": (0.0, 50.0)}
"""[rad, m]; a limit has no unit. Beyond, an action would not be a finite number."""

Level = Literal["high", "low", "end-to-end", "finger", "fingering", "hand-motion", "hand-controls"]
"""From goals to fingertips; from fingertips to controls; from goals straight to controls; from one
finger's surroundings to what it adds to the base controller; and the stages of a player of three:
from goals to fingers, from these to the fingertips of a hand, and on to its controls."""
NetworkKind = Literal["diffusion", "bet", "mlp"]
Prediction = Literal["epsilon", "sample"]
"""What a diffusion network outputs: the noise, or the sample without it (Ho et al., "Denoising
diffusion probabilistic models", 2020)."""

Inference = Callable[[dict[str, NDArray[Any]]], list[NDArray[np.float32]]]
"""Runs a network: named input arrays to a list of output arrays."""


@dataclass(frozen=True)
class AsinhNormalizer:
    """Actions of a diffusion, normalized to -1..1 by an area hyperbolic sine.

    Linear near the median, logarithmic in the tails: see the normalizer of the same name in
    `pianomime.learn.imitation.normalizer`, which fits it.

    Attributes:
        median: (D,) the action that becomes 0 [rad, m].
        unit: (D,) distance from the median up to which it is about linear [rad, m].
        limit: (D,) asinh((action - median) / unit) that becomes 1.

    Raises:
        InputError: they are not three rows of finite numbers of one length.
    """

    median: tuple[float, ...]
    unit: tuple[float, ...]
    limit: tuple[float, ...]

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name, values in vars(self).items():
            try:
                numbers = tuple(map(float, values))
            except (TypeError, ValueError) as error:
                raise InputError(f"normalizer.{name} must be numbers") from error
            if len(numbers) != len(self.median) or not np.isfinite(numbers).all():
                raise InputError(f"normalizer.{name} must be {len(self.median)} finite numbers")
            least, most = _NORMALIZER_RANGE[name]
            if numbers and not (min(numbers) >= least and max(numbers) <= most):
                raise InputError(f"normalizer.{name} must be {least:g} to {most:g}")
            object.__setattr__(self, name, numbers)

    def denormalize(self, normalized: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (..., D) [rad, m] of normalized ones (..., D)."""
        median, unit, limit = (
            np.array(row, np.float32) for row in (self.median, self.unit, self.limit)
        )
        action: NDArray[np.float32] = np.sinh(normalized * limit) * unit + median
        return action


@dataclass(frozen=True)
class DiffusionInfo:
    """What sampling from a diffusion needs to know of its training.

    Attributes:
        steps: steps of the diffusion in training.
        prediction: what the network outputs.
        normalizer: of its actions.

    Raises:
        InputError: one of them is not of its kind.
    """

    steps: int
    prediction: Prediction
    normalizer: AsinhNormalizer

    def __post_init__(self) -> None:
        _check_integer("diffusion.steps", self.steps, 2, MOST_DIFFUSION_STEPS)
        _check_choice("diffusion.prediction", self.prediction, get_args(Prediction))


@dataclass(frozen=True)
class PolicyInfo:
    """What a policy is, as its file tells; in the file it is JSON, see `to_metadata`.

    Attributes:
        name: such as "high-diff", which `pianomime train` takes.
        level: what it maps from and to.
        network: kind of network.
        action_size: D, numbers of the action for one frame.
        chunk: T, frames of actions that one call predicts.
        residual: whether actions are added to those of the base controller.
        diffusion: how a diffusion was trained; None for other networks.
        data: hash that identifies the training data; "" if it was not recorded.
        licence: SPDX identifier, or a few words; "" if nobody said.

    Raises:
        InputError: a field is not of its kind, or two do not fit together.
    """

    name: str
    level: Level
    network: NetworkKind
    action_size: int
    chunk: int = 1
    residual: bool = False
    diffusion: DiffusionInfo | None = None
    data: str = ""
    licence: str = ""

    def __post_init__(self) -> None:
        for field in ("name", "data", "licence"):
            if not isinstance(getattr(self, field), str):
                raise InputError(f"{field} must be text, not {getattr(self, field)!r}")
        _check_choice("level", self.level, get_args(Level))
        _check_choice("network", self.network, get_args(NetworkKind))
        _check_integer("action_size", self.action_size, 1, _MOST_NUMBERS)
        _check_integer("chunk", self.chunk, 1, CHUNK)
        if not isinstance(self.residual, bool):
            raise InputError(f"residual must be true or false, not {self.residual!r}")
        if self.residual and self.level == "high":
            raise InputError("a policy that outputs fingertips has no base controller to add to")
        if (self.network == "diffusion") != (self.diffusion is not None):
            raise InputError("a diffusion network, and no other, tells of its diffusion")
        if self.diffusion is not None:
            size = len(self.diffusion.normalizer.median)
            if size != self.action_size:
                raise InputError(f"normalizer of {size} numbers for actions of {self.action_size}")

    @classmethod
    def from_metadata(cls, metadata: str) -> PolicyInfo:
        """Read what `to_metadata` wrote.

        Raises:
            InputError: it is something else, of another version, or says what cannot be.
        """
        try:
            content = parse_json(metadata)
        except InputError as error:
            raise InputError(f"metadata: {error}") from error
        if not isinstance(content, dict) or content.pop("format", None) != FORMAT:
            raise InputError(f"not a {FORMAT}")
        version = content.pop("version", None)
        if version != VERSION:
            raise InputError(f"a policy of version {version}; this program reads {VERSION}")
        diffusion = content.pop("diffusion", None)
        if diffusion is not None:
            _check_fields(DiffusionInfo, diffusion, "diffusion")
            normalizer = diffusion["normalizer"]
            _check_fields(AsinhNormalizer, normalizer, "normalizer")
            diffusion = DiffusionInfo(**diffusion | {"normalizer": AsinhNormalizer(**normalizer)})
        content["diffusion"] = diffusion
        _check_fields(cls, content)
        return cls(**content)

    def to_metadata(self) -> str:
        """JSON with `format`, `version` and every field."""
        return json.dumps({"format": FORMAT, "version": VERSION, **asdict(self)})


class Policy(Protocol):
    """Predicts action chunks (Zhao et al., "Learning fine-grained bimanual manipulation", 2023)."""

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """Chunks of actions, sampled where the policy is stochastic.

        Args:
            observation: of B worlds, as `pianomime.policies.features` encodes it.
            rng: source of all randomness; policies that are deterministic leave it alone.

        Returns:
            (B, T, D) of this frame and those that follow: points (2, 6, 3) in a row, relative to
            the wrist, of a high level [m]; controls of others, or what a residual policy adds to
            them [rad, m].
        """
        ...


@dataclass(frozen=True, eq=False)
class NetworkPolicy:
    """A policy whose network is run by a function: by ONNX Runtime, or by torch in training.

    Attributes:
        run: the network; inputs `goal`, `frames` and `vector` of an observation, and for a
            diffusion `noisy` (B, T, D) and `step` (B,) int64.
        info: what it is.
        sampler: how a diffusion is sampled.
    """

    run: Inference
    info: PolicyInfo
    sampler: Sampler

    def act(self, observation: Observation, rng: np.random.Generator) -> NDArray[np.float32]:
        """As `Policy.act`."""
        info = self.info
        # Exported networks have no inputs of size 0.
        inputs = {
            name: observation[name]
            for name in ("goal", "frames", "vector")
            if observation[name].size
        }
        if info.diffusion is not None:
            shape = (len(observation["goal"]), info.chunk, info.action_size)
            normalized = ddim_sample(
                lambda noisy, step: self.run({**inputs, "noisy": noisy, "step": step})[0],
                rng.standard_normal(shape).astype(np.float32),
                info.diffusion.steps,
                info.diffusion.prediction,
                self.sampler,
                rng,
            )
            action = info.diffusion.normalizer.denormalize(normalized)
        elif info.network == "bet":
            # Behaviour transformer: sample a bin, and take that bin's corrected action.
            probability, actions = self.run(inputs)
            bins = (rng.random((*probability.shape[:2], 1)) > probability.cumsum(axis=2)).sum(
                axis=2
            )
            bins = np.minimum(bins, probability.shape[2] - 1)
            action = np.take_along_axis(actions, bins[..., None, None], axis=2)[:, :, 0]
        else:
            action = self.run(inputs)[0]
        reference = action_reference(info.level, info.residual, observation["vector"])
        absolute: NDArray[np.float32] = action + reference
        return absolute


def _check_integer(name: str, value: Any, least: int, most: int) -> None:
    if type(value) is not int or not least <= value <= most:
        raise InputError(f"{name} must be a whole number from {least} to {most}")


def _check_choice(name: str, value: Any, choices: tuple[str, ...]) -> None:
    if not isinstance(value, str) or value not in choices:
        raise InputError(f"{name} must be one of {', '.join(choices)}")


def _check_fields(kind: type[Any], content: object, part: str = "") -> None:
    """Refuse metadata that are not an object with exactly the fields of a class."""
    known = {field.name for field in fields(kind)}
    if not isinstance(content, dict):
        raise InputError(f"{part} must be an object, not {content!r}")
    if set(content) != known:
        odd = ", ".join(sorted(f"{part}.{name}".lstrip(".") for name in known ^ set(content)))
        raise InputError(f"metadata with fields missing or unknown: {odd}")
