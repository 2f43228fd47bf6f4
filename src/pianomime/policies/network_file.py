"""Reader of policies' ONNX files, which are checked before they are run, and while they run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.installation import install_command
from pianomime.policies.interface import ACTION_SIZES, Shapes, inputs_of, outputs_of
from pianomime.policies.policy import (
    METADATA,
    VERSION,
    Inference,
    NetworkPolicy,
    PolicyInfo,
)
from pianomime.policies.sampler import Sampler
from pianomime.policies.stamp import check_stamp

_MOST_BYTES = 1024**3
"""Bytes of the largest file that is read."""


def load_policy(path: Path, sampler: Sampler | None = None, name: str = "") -> NetworkPolicy:
    """A policy from its ONNX file, run by ONNX Runtime.

    Args:
        path: of the file.
        sampler: how a diffusion is sampled.
        name: that the policy must have; any if not given.

    Raises:
        InputError: as `load_network`.
    """
    run, info = load_network(path, name)
    return NetworkPolicy(run, info, sampler or Sampler())


def load_network(path: Path, name: str = "") -> tuple[Inference, PolicyInfo]:
    """The network of an ONNX file, and its metadata.

    The network raises an `InputError` when its output has another shape than the metadata say, or
    is not finite.

    Args:
        path: of the file.
        name: that the policy must have; any if not given.

    Raises:
        InputError: there is no such file, it is damaged, was changed, is of another version or of
            another policy, has other inputs or outputs than such a policy, or ONNX Runtime is not
            installed.
    """
    try:
        import onnxruntime
    except ImportError as error:
        raise InputError(
            f"learned players need the package onnxruntime: {install_command('learned')}"
        ) from error
    if not path.is_file():
        raise InputError(f"{path}: does not exist")
    options = onnxruntime.SessionOptions()
    # Networks are small: more threads gain nothing, and wait on the cores of the physics.
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    content = _content(path)
    try:
        session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        properties = session.get_modelmeta().custom_metadata_map
    # ONNX Runtime's errors have no class in common but this.
    except Exception as error:
        raise InputError(f"{path}: damaged, or not an ONNX file") from error
    if METADATA not in properties:
        raise InputError(f"{path}: not a policy of version {VERSION} of this program's format")
    try:
        info = PolicyInfo.from_metadata(properties[METADATA])
        if name not in ("", info.name):
            raise InputError(f"holds the policy {info.name}, not {name}")
        if info.action_size != ACTION_SIZES[info.level]:
            raise InputError(
                f"an action of the level {info.level} has {ACTION_SIZES[info.level]} numbers, not "
                f"{info.action_size}"
            )
        _check("input", inputs_of(info), session.get_inputs())
        _check("output", outputs_of(info), session.get_outputs())
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    outputs = outputs_of(info)

    def run(inputs: dict[str, NDArray[Any]]) -> list[NDArray[np.float32]]:
        batch = len(next(iter(inputs.values())))
        try:
            arrays: list[NDArray[np.float32]] = session.run(list(outputs), inputs)
        except Exception as error:
            raise InputError(f"{path}: the network cannot be run") from error
        for array, (output, shape) in zip(arrays, outputs.items(), strict=True):
            if not _fits((batch, *shape), array.shape) or not np.isfinite(array).all():
                raise InputError(f"{path}: the network's {output} is not what it should be")
        # Sizes that a policy leaves open, such as a number of bins, are one size.
        free = {
            array.shape[1 + shape.index(None)]
            for array, shape in zip(arrays, outputs.values(), strict=True)
            if None in shape
        }
        if len(free) > 1 or 0 in free:
            raise InputError(f"{path}: the network's outputs do not fit together")
        return arrays

    return run, info


def _content(path: Path) -> bytes:
    """The bytes of a stamped file.

    Raises:
        InputError: it is too large, or not as it was when it was stamped.
    """
    if path.stat().st_size > _MOST_BYTES:
        raise InputError(f"{path}: damaged, or not an ONNX file: it is too large")
    content = path.read_bytes()
    try:
        check_stamp(content)
    except InputError as error:
        raise InputError(f"{path}: damaged, or not a policy: {error}") from error
    return content


def _check(what: str, wanted: Shapes, given: Sequence[Any]) -> None:
    """Check the inputs or the outputs that a network declares."""
    there = {each.name: each for each in given}
    if set(there) != set(wanted):
        raise InputError(f"has the {what}s {', '.join(there)}, not {', '.join(wanted)}")
    for name, shape in wanted.items():
        kind = "int64" if name == "step" else "float"
        declared = [size if isinstance(size, int) else None for size in there[name].shape]
        if there[name].type != f"tensor({kind})" or not _fits((None, *shape), declared):
            raise InputError(f"the {what} {name} has another type or shape than such a policy's")


def _fits(wanted: Sequence[int | None], given: Sequence[int | None]) -> bool:
    """Whether shapes agree, as far as both are known."""
    return len(wanted) == len(given) and all(
        None in pair or pair[0] == pair[1] for pair in zip(wanted, given, strict=True)
    )
