"""From a trained stage to the ONNX file that is played."""

from __future__ import annotations

import json
import logging
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from pianomime.files import atomic
from pianomime.keyboard import KEYS
from pianomime.learn.imitation.bet import BetNet
from pianomime.learn.imitation.diffusion import DiffusionNet
from pianomime.learn.imitation.network import Stage
from pianomime.policies.horizon import CHUNK, HIGH_GOALS
from pianomime.policies.policy import FORMAT, VERSION, OnnxPolicy
from pianomime.policies.sampler import Sampler

_SMALL = 1024
"""Numbers in a weight that is kept as it is."""


def export_stage(stage: Stage, name: str, path: Path) -> None:
    """Write a stage as ONNX, whole or not at all.

    Args:
        stage: trained.
        name: of it.
        path: where to.

    Raises:
        OSError: it cannot be written.
    """
    given, names = _example(stage)
    outputs = ["chance", "exact"] if stage.config.network == "bet" else ["said"]
    export_network(_Asked(stage).eval(), given, names, outputs, about_stage(stage, name), path)


def export_network(
    network: nn.Module,
    given: tuple[Tensor, ...],
    names: list[str],
    outputs: list[str],
    about: dict[str, Any],
    path: Path,
) -> None:
    """Write a network as ONNX, whole or not at all.

    Args:
        network: in eval mode.
        given: examples of what it is given, in batches.
        names: of these.
        outputs: names of what it says.
        about: what the file tells of it.
        path: where to.

    Raises:
        OSError: it cannot be written.
    """
    import onnx

    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        logging.getLogger("torch.onnx").setLevel(logging.ERROR)
        raw = Path(folder, "stage.onnx")
        torch.onnx.export(
            network,
            given,
            str(raw),
            input_names=names,
            output_names=outputs,
            dynamic_axes={one: {0: "batch"} for one in (*names, *outputs)},
            dynamo=False,
        )
        model = onnx.load(str(raw))
    _halve(model)
    onnx.helper.set_model_props(
        model, {"about": json.dumps({"format": FORMAT, "version": VERSION, **about})}
    )
    with atomic(path) as temporary:
        temporary.write_bytes(model.SerializeToString())


def torch_policy(stage: Stage, name: str = "", sampler: Sampler | None = None) -> OnnxPolicy:
    """A stage that is run by torch, to be looked at while it learns."""
    asked = _Asked(stage)

    def run(given: dict[str, NDArray[Any]]) -> list[NDArray[np.float32]]:
        device = stage.target.middle.device
        training = stage.training
        with torch.inference_mode():
            out = asked.eval()(*(torch.from_numpy(value).to(device) for value in given.values()))
        stage.train(training)
        return [one.cpu().numpy() for one in (out if isinstance(out, tuple) else (out,))]

    return OnnxPolicy(run, about_stage(stage, name), sampler or Sampler())


def about_stage(stage: Stage, name: str) -> dict[str, Any]:
    """What a file of a stage tells of itself."""
    config = stage.config
    about: dict[str, Any] = {
        "stage": name,
        "level": config.level,
        "prior": config.prior,
        "network": config.network,
        "chunk": config.chunk,
        "width": len(stage.target.middle),
    }
    if config.network == "diffusion":
        about |= {
            "steps": config.diffusion.steps,
            "prediction": config.diffusion.prediction,
            "scale": {
                "middle": stage.target.middle.tolist(),
                "unit": stage.target.unit.tolist(),
                "limit": stage.target.limit.tolist(),
            },
        }
    return about


def _halve(model: Any) -> None:
    """Keep weights in 16 bits, made 32 when the file is read: half the size, the same speed."""
    import onnx

    casts = []
    for weight in model.graph.initializer:
        values = onnx.numpy_helper.to_array(weight)
        if values.dtype != np.float32 or values.size < _SMALL:
            continue
        name = weight.name
        half = onnx.numpy_helper.from_array(values.astype(np.float16), f"{name}/half")
        weight.CopyFrom(half)
        casts.append(onnx.helper.make_node("Cast", [half.name], [name], to=onnx.TensorProto.FLOAT))
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)


class _Asked(nn.Module):
    """A stage as it is called when it plays; only what it sees is an argument."""

    def __init__(self, stage: Stage) -> None:
        super().__init__()
        self.stage = stage
        self.flat = not len(stage.frames.middle)

    def forward(self, *given: Tensor) -> Tensor | tuple[Tensor, Tensor]:
        rest = list(given)
        goal = rest.pop(0)
        frames = goal[..., :0] if self.flat else rest.pop(0)
        ahead, vector = self.stage.seen(goal, frames, rest.pop(0))
        net, target = self.stage.net, self.stage.target
        if isinstance(net, DiffusionNet):
            noisy, step = rest
            out: Tensor = net(ahead, vector, noisy, step)
            return out
        if isinstance(net, BetNet):
            chance, exact = net(ahead, vector)
            return chance, target.undo(exact)
        return target.undo(net(ahead, vector))


def _example(stage: Stage) -> tuple[tuple[Tensor, ...], list[str]]:
    """Arguments, and what they are called."""
    width = len(stage.target.middle)
    frames = HIGH_GOALS if stage.config.level == "high" else CHUNK
    given = {"goal": torch.zeros(2, frames, KEYS)}
    if len(stage.frames.middle):
        given["frames"] = torch.zeros(2, frames, len(stage.frames.middle))
    given["vector"] = torch.zeros(2, len(stage.vector.middle))
    if isinstance(stage.net, DiffusionNet):
        given["noisy"] = torch.zeros(2, stage.config.chunk, width)
        given["step"] = torch.zeros(2, dtype=torch.int64)
    return tuple(given.values()), list(given)
