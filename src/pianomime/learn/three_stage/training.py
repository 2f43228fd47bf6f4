"""Training of one of the three stages, from data sets to the file that is played."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from pianomime.errors import InputError
from pianomime.learn.data.dataset import (
    DEMONSTRATION_COLUMNS,
    Dataset,
    trajectory_dataset,
)
from pianomime.learn.imitation.export import export_network
from pianomime.learn.runs.trainer import train_network
from pianomime.learn.three_stage.config import STAGES, StageConfig, StageName
from pianomime.learn.three_stage.fingering_samples import FingeringSamples
from pianomime.learn.three_stage.hand_samples import (
    CONTROLS_COLUMNS,
    ControlsSamples,
    MotionSamples,
)
from pianomime.learn.three_stage.network import ChoiceNetwork, MotionNetwork, StageNetwork
from pianomime.policies.horizon import CHUNK
from pianomime.policies.policy import PolicyInfo
from pianomime.policies.three_stage import fingering, hand_controls, hand_motion
from pianomime.progress import Progress, no_progress
from pianomime.validation import one_of

_NORMALIZER_SAMPLES = 20_000
"""Training samples that the normalizers are fitted to."""
_VALIDATION_SAMPLES = 4096
"""Samples of the validation songs on which errors are measured."""
_OUTPUTS = {
    "fingering": (1, fingering.CHOICES),
    "hand-motion": (CHUNK, hand_motion.PLANE),
    "hand-controls": (1, hand_controls.ACTIONS),
}
"""Frames and numbers of an action, by stage."""


def train_stage(
    name: StageName,
    config: StageConfig,
    out: Path,
    experts: Sequence[Path],
    progress: Progress = no_progress,
) -> Path:
    """Train a stage, or resume its training.

    Args:
        name: of the stage.
        config: how to train it.
        out: folder; `NAME.onnx` is the result, and `NAME` holds the training.
        experts: data sets of trajectories, such as `perform` makes.
        progress: called as the data are read, and with the updates that were done.

    Returns:
        The ONNX file.

    Raises:
        InputError: there is no such stage, data are missing or cannot be used, or the folder holds
            another training.
        OSError: a file cannot be read or written.
    """
    one_of("stage", name, STAGES)
    progress("reading", 0, 0)
    columns = CONTROLS_COLUMNS if name == "hand-controls" else DEMONSTRATION_COLUMNS
    dataset = trajectory_dataset(experts, columns)
    if len(set(dataset.song_id.tolist())) < 2:
        raise InputError("two songs at least are needed, one of them for validation")
    train, validation = (_samples(name, part) for part in dataset.split())
    seed = config.trainer.seed
    if not (len(train) and len(validation)):
        raise InputError("the data hold no notes to learn from, or none in songs for validation")
    sample = train.draw(np.random.default_rng(seed), _NORMALIZER_SAMPLES)
    inputs, outputs = sample["observation"].shape[1], _OUTPUTS[name]
    torch.manual_seed(seed)
    kind = ChoiceNetwork if name == "fingering" else MotionNetwork
    network = kind(inputs, outputs, config)
    network.fit(sample)
    settings = dataclasses.asdict(config)
    # The trainer adds its own.
    del settings["trainer"]
    digest = dataset.digest()
    held_out = validation.evenly(_VALIDATION_SAMPLES)
    out.mkdir(parents=True, exist_ok=True)
    train_network(
        out / name,
        _Loss(network),
        lambda module, batch: module(batch),
        train.draw,
        config.trainer,
        _evaluation(held_out),
        progress,
        {"stage": name, **settings, "data": digest},
        held_out=held_out,
    )
    progress("exporting", 0, 0)
    result = out / f"{name}.onnx"
    info = PolicyInfo(name, name, "mlp", outputs[1], outputs[0], data=digest)
    export_network(network, {"observation": torch.zeros(2, inputs)}, ["action"], info, result, True)
    return result


def _samples(name: StageName, dataset: Dataset) -> Any:
    """The samples of a stage."""
    if name == "fingering":
        return FingeringSamples.of(dataset)
    return MotionSamples(dataset) if name == "hand-motion" else ControlsSamples.of(dataset)


class _Loss(nn.Module):
    """The loss of a network as a module: what trains on several GPUs calls modules."""

    def __init__(self, network: StageNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, batch: dict[str, torch.Tensor]) -> torch.Tensor:
        return self.network.loss(batch)


def _evaluation(
    held_out: dict[str, NDArray[Any]],
) -> Callable[[nn.Module], dict[str, float]]:
    """Measures errors in songs that are kept from training.

    For choices the share that is as in the data; for actions the mean error, and that of an action
    of zeros [rad, m].
    """
    observation = torch.from_numpy(held_out["observation"])
    target = held_out["target"]

    def evaluate(module: nn.Module) -> dict[str, float]:
        assert isinstance(module, _Loss)
        device = next(module.parameters()).device
        action = module.network(observation.to(device)).cpu().numpy()
        if target.ndim == 1:
            return {"validation/as_in_the_data": float((action[:, 0].argmax(1) == target).mean())}
        return {
            "validation/error": float(np.abs(action - target).mean()),
            "validation/error_of_zero": float(np.abs(target).mean()),
        }

    return evaluate
