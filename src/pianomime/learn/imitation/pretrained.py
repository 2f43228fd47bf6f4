"""Fine-tuning: a training that begins with the weights of a policy's file.

ONNX export names weights as torch does, but for those that it reshapes: biases of convolutions, and
the weights of group normalizations. Which these are is told by the node that reads them, whose name
is the path of its module. Of transformers more is lost, so that these are not fine-tuned.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.imitation.config import PolicyConfig
from pianomime.learn.imitation.network import PolicyNetwork
from pianomime.policies.network_file import load_network
from pianomime.policies.policy import PolicyInfo

_NAMED = "network.network."
"""Before the names of weights in an exported file: the modules around the policy's network."""
_READ_BY = {"Mul": "weight", "Add": "bias"}
"""Operations that read weights without a name, and which weights of their module these are."""


def check_pretrained(config: PolicyConfig, path: Path) -> PolicyInfo:
    """Refuse to train a policy further as one of another kind.

    Args:
        config: of the policy that is to be trained.
        path: of the ONNX file.

    Returns:
        What the file's policy is.

    Raises:
        InputError: there is no such file, it is damaged, it is that of another kind of policy, or
            one of a kind that cannot be fine-tuned.
    """
    _, info = load_network(path)
    if config.network == "bet":
        raise InputError("behaviour transformers cannot be fine-tuned: their files lack names")
    wanted = {name: getattr(config, name) for name in ("level", "network", "residual", "chunk")}
    given = {name: getattr(info, name) for name in wanted}
    if config.network == "diffusion" and info.diffusion is not None:
        for name in ("steps", "prediction"):
            wanted[f"diffusion.{name}"] = getattr(config.diffusion, name)
            given[f"diffusion.{name}"] = getattr(info.diffusion, name)
    for name, value in wanted.items():
        if given[name] != value:
            raise InputError(
                f"{path}: another kind of policy: {name} is {given[name]}, not {value}"
            )
    return info


def load_pretrained(network: PolicyNetwork, path: Path) -> None:
    """Put the weights of a policy's file into a network, normalizers and goal encoder included.

    Large weights are in the file in 16 bits.

    Args:
        network: changed in place.
        path: of the ONNX file, which `export_policy` wrote and `check_pretrained` has let pass.

    Raises:
        InputError: it is damaged, or that of a network of another size.
    """
    import onnx

    _, info = load_network(path)
    arrays = _weights(onnx.load(str(path)))
    if info.diffusion is not None:
        for name, row in vars(info.diffusion.normalizer).items():
            arrays[f"action_normalizer.{name}"] = np.array(row, np.float32)
    state = network.state_dict()
    for name, tensor in state.items():
        # Exported networks have no inputs of size 0, nor their normalizers.
        if not tensor.numel():
            continue
        array = arrays.get(name)
        if array is None or array.size != tensor.numel():
            raise InputError(f"{path}: another size of network, or kind of goals ({name})")
        state[name] = torch.tensor(array).reshape(tensor.shape)
    left = sorted(set(arrays) - set(state))
    if left:
        raise InputError(f"{path}: another size of network, or kind of goals ({left[0]})")
    network.load_state_dict(state)


def _weights(model: Any) -> dict[str, NDArray[np.float32]]:
    """The weights of an exported network by torch's names of them."""
    import onnx

    stored = {
        weight.name: onnx.numpy_helper.to_array(weight).astype(np.float32)
        for weight in model.graph.initializer
    }
    for node in model.graph.node:
        if node.op_type == "Cast" and node.input[0] in stored:
            stored[node.output[0]] = stored.pop(node.input[0])
    named = {
        name.removeprefix(_NAMED): array
        for name, array in stored.items()
        if name.startswith(_NAMED)
    }
    for node in model.graph.node:
        for name in set(node.input) & set(stored):
            if node.op_type in _READ_BY and not name.startswith(_NAMED):
                named[f"{_module(node.name)}.{_READ_BY[node.op_type]}"] = stored[name]
    return named


def _module(node: str) -> str:
    """Name of the module to which a node belongs, by the node's path of modules as they call.

    Args:
        node: such as "/network/net/layers/layers.0/Add".
    """
    path: list[str] = []
    for part in node.strip("/").split("/")[1:-1]:
        # A sequence's parts have its name before their numbers.
        if path and part.startswith(f"{path[-1]}."):
            path.pop()
        path.append(part)
    return ".".join(path)
