"""From a trained policy to the ONNX file that is played."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from pianomime.files import atomic
from pianomime.keyboard import KEYS
from pianomime.learn.imitation.network import PolicyNetwork
from pianomime.policies.horizon import CHUNK, GOAL_HORIZON
from pianomime.policies.policy import (
    METADATA,
    AsinhNormalizer,
    DiffusionInfo,
    NetworkPolicy,
    PolicyInfo,
)
from pianomime.policies.sampler import Sampler
from pianomime.policies.stamp import stamped
from pianomime.staging import scratch

_MIN_SHRUNK = 1024
"""Weights with fewer numbers than this are kept in 32 bits."""
_MOST_INT8 = 127
"""Greatest whole number of 8 bits that has a negative."""


def export_policy(network: PolicyNetwork, info: PolicyInfo, path: Path) -> None:
    """Write a policy as ONNX, whole or not at all.

    Args:
        network: trained.
        info: its metadata.
        path: of the file.

    Raises:
        OSError: it cannot be written.
    """
    outputs = ["probability", "actions"] if info.network == "bet" else ["action"]
    export_network(_Predict(network), _example(network), outputs, info, path)


def export_network(
    network: nn.Module,
    example: Mapping[str, Tensor],
    outputs: Sequence[str],
    info: PolicyInfo,
    path: Path,
    compact: bool = False,
) -> None:
    """Write a network as ONNX, whole or not at all.

    Args:
        network: called with the inputs by name.
        example: a batch of inputs by name.
        outputs: names of the outputs.
        info: metadata of the policy.
        path: of the file.
        compact: store matrices in 8 bits, one scale a row, rather than in 16.

    Raises:
        OSError: it cannot be written.
    """
    import onnx

    names = list(example)
    with scratch() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        logging.getLogger("torch.onnx").setLevel(logging.ERROR)
        raw = folder / "policy.onnx"
        torch.onnx.export(
            _ByPosition(network, names).eval(),
            tuple(example.values()),
            str(raw),
            input_names=names,
            output_names=list(outputs),
            dynamic_axes={name: {0: "batch"} for name in (*names, *outputs)},
            dynamo=False,
        )
        model = onnx.load(str(raw))
    _shrink(model, compact)
    onnx.helper.set_model_props(model, {METADATA: info.to_metadata()})
    with atomic(path) as temporary:
        temporary.write_bytes(stamped(model.SerializeToString()))


def torch_policy(
    network: PolicyNetwork, name: str = "", sampler: Sampler | None = None
) -> NetworkPolicy:
    """A policy that is run by torch, to be evaluated in training.

    Args:
        network: in training or trained; it stays in the mode it is in.
        name: of the policy.
        sampler: how a diffusion is sampled.
    """

    def run(inputs: dict[str, NDArray[Any]]) -> list[NDArray[np.float32]]:
        device = network.action_normalizer.median.device
        training = network.training
        with torch.inference_mode():
            tensors = {name: torch.from_numpy(value).to(device) for name, value in inputs.items()}
            outputs = network.eval().predict(**tensors)
        network.train(training)
        return [output.cpu().numpy() for output in outputs]

    return NetworkPolicy(run, policy_info(network, name), sampler or Sampler())


def policy_info(network: PolicyNetwork, name: str, data: str = "") -> PolicyInfo:
    """The metadata of a policy.

    Args:
        network: the policy.
        name: its name.
        data: hash of its training data.
    """
    config, diffusion = network.config, None
    if config.network == "diffusion":
        normalizer = network.action_normalizer
        diffusion = DiffusionInfo(
            config.diffusion.steps,
            config.diffusion.prediction,
            AsinhNormalizer(
                tuple(normalizer.median.tolist()),
                tuple(normalizer.unit.tolist()),
                tuple(normalizer.limit.tolist()),
            ),
        )
    return PolicyInfo(
        name=name,
        level=config.level,
        network=config.network,
        action_size=network.action_size,
        chunk=config.chunk,
        residual=config.residual,
        diffusion=diffusion,
        data=data,
    )


def _shrink(model: Any, compact: bool) -> None:
    """Store weights in fewer bits, and have them made 32 again when the file is loaded.

    Args:
        model: changed in place.
        compact: matrices in 8 bits, one scale a row; otherwise everything large in 16.
    """
    import onnx

    restored = []
    for weight in list(model.graph.initializer):
        values = onnx.numpy_helper.to_array(weight)
        if values.dtype != np.float32 or values.size < _MIN_SHRUNK:
            continue
        name = weight.name
        small = f"{name}/small"
        if compact and values.ndim == 2:
            scale = np.maximum(np.abs(values).max(axis=1), np.finfo(np.float32).tiny) / _MOST_INT8
            rounded = np.rint(values / scale[:, None]).astype(np.int8)
            weight.CopyFrom(onnx.numpy_helper.from_array(rounded, small))
            scales = onnx.numpy_helper.from_array(scale.astype(np.float32), f"{name}/scale")
            model.graph.initializer.append(scales)
            restored.append(
                onnx.helper.make_node("DequantizeLinear", [small, scales.name], [name], axis=0)
            )
        else:
            weight.CopyFrom(onnx.numpy_helper.from_array(values.astype(np.float16), small))
            restored.append(
                onnx.helper.make_node("Cast", [small], [name], to=onnx.TensorProto.FLOAT)
            )
    nodes = [*restored, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)


class _Predict(nn.Module):
    """`PolicyNetwork.predict` as a module of its own, for ONNX export calls modules."""

    def __init__(self, network: PolicyNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, **inputs: Tensor) -> tuple[Tensor, ...]:
        return self.network.predict(**inputs)


class _ByPosition(nn.Module):
    """Calls a network with named inputs where ONNX export passes them by position."""

    def __init__(self, network: nn.Module, names: Sequence[str]) -> None:
        super().__init__()
        self.network, self.names = network, names

    def forward(self, *inputs: Tensor) -> Any:
        return self.network(**dict(zip(self.names, inputs, strict=True)))


def _example(network: PolicyNetwork) -> dict[str, Tensor]:
    """A batch of inputs by name; inputs of size 0 are left out."""
    config = network.config
    frames = GOAL_HORIZON if config.level == "high" else CHUNK
    example = {"goal": torch.zeros(2, frames, KEYS)}
    if network.frame_features:
        example["frames"] = torch.zeros(2, frames, network.frame_features)
    example["vector"] = torch.zeros(2, network.vector_features)
    if config.network == "diffusion":
        example["noisy"] = torch.zeros(2, config.chunk, network.action_size)
        example["step"] = torch.zeros(2, dtype=torch.int64)
    return example
