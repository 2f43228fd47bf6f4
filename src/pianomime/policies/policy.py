"""A trained stage of a generalist, as an ONNX file, run without torch."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.policies.features import Arrays, base
from pianomime.policies.sampler import Sampler, ddim_sample

FORMAT = "pianomime stage"
VERSION = 1


Inference = Callable[[dict[str, NDArray[Any]]], list[NDArray[np.float32]]]
"""Gives what a network says of what it is given, by name."""


class Policy(Protocol):
    """Says chunks."""

    def say(self, seen: Arrays, draw: np.random.Generator) -> NDArray[np.float32]:
        """(B, T, D) of what is seen, as `pianomime.policies.features` makes it."""
        ...


@dataclass(frozen=True, eq=False)
class OnnxPolicy:
    """A trained stage.

    Attributes:
        run: the network.
        about: `stage`, `level`, `prior`, `network`, `chunk`, `width`, and of a diffusion `steps`
            and `prediction`, and the `scale` of what is said.
        sampler: how a diffusion is run.
    """

    run: Inference
    about: dict[str, Any]
    sampler: Sampler

    def say(self, seen: Arrays, draw: np.random.Generator) -> NDArray[np.float32]:
        """As `Policy.say`."""
        about = self.about
        given = {name: seen[name] for name in ("goal", "frames", "vector") if seen[name].size}
        if about["network"] == "diffusion":
            noise = draw.standard_normal((len(seen["goal"]), about["chunk"], about["width"]))
            scaled = ddim_sample(
                lambda noisy, step: self.run({**given, "noisy": noisy, "step": step})[0],
                noise.astype(np.float32),
                about["steps"],
                about["prediction"],
                self.sampler,
                draw,
            )
            scale = {name: np.float32(values) for name, values in about["scale"].items()}
            said = np.sinh(scaled * scale["limit"]) * scale["unit"] + scale["middle"]
        elif about["network"] == "bet":
            chance, exact = self.run(given)
            pick = (draw.random((*chance.shape[:2], 1)) > chance.cumsum(axis=2)).sum(axis=2)
            pick = np.minimum(pick, chance.shape[2] - 1)
            said = np.take_along_axis(exact, pick[..., None, None], axis=2)[:, :, 0]
        else:
            said = self.run(given)[0]
        relative: NDArray[np.float32] = said + base(about["level"], about["prior"], seen["vector"])
        return relative


def load_policy(path: Path, sampler: Sampler | None = None, stage: str = "") -> OnnxPolicy:
    """A stage that was exported, run by ONNX Runtime.

    Args:
        path: of the file.
        sampler: how a diffusion is run.
        stage: as `load_network`.

    Raises:
        InputError: as `load_network`.
    """
    run, about = load_network(path, stage)
    return OnnxPolicy(run, about, sampler or Sampler())


def load_network(path: Path, stage: str = "") -> tuple[Inference, dict[str, Any]]:
    """A network that was exported: what runs it, and what it tells of itself.

    Args:
        path: of the file.
        stage: that it must hold; any if not given.

    Raises:
        InputError: there is no such file, it is damaged, of another version or of another stage, or
            ONNX Runtime is not installed.
    """
    try:
        import onnxruntime
    except ImportError as error:
        raise InputError(
            "learned players need the package onnxruntime: pip install -e '.[learned]'"
        ) from error
    if not path.is_file():
        raise InputError(f"{path}: does not exist")
    options = onnxruntime.SessionOptions()
    # Networks are small: more threads gain nothing, and wait on the cores of the physics.
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    try:
        session = onnxruntime.InferenceSession(
            str(path), options, providers=["CPUExecutionProvider"]
        )
        about = json.loads(session.get_modelmeta().custom_metadata_map["about"])
        known = about["format"] == FORMAT and about["version"] == VERSION
    # ONNX Runtime's errors have no class in common but this.
    except Exception as error:
        raise InputError(f"{path}: damaged, or not a stage of a player") from error
    if not known:
        raise InputError(f"{path}: a stage of another version than this program's")
    if stage not in ("", about["stage"]):
        raise InputError(f"{path}: holds the stage {about['stage']}, not {stage}")
    return lambda given: session.run(None, given), about
