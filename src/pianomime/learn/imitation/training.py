"""Training of a policy by imitation, from data sets to the file that is played."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.data.dataset import (
    DEMONSTRATION_COLUMNS,
    TRAJECTORY_COLUMNS,
    Dataset,
    demonstration_dataset,
    trajectory_dataset,
)
from pianomime.learn.imitation.config import PolicyConfig, check_sources
from pianomime.learn.imitation.export import export_policy, policy_info, torch_policy
from pianomime.learn.imitation.network import PolicyNetwork
from pianomime.learn.imitation.pretrained import check_pretrained, load_pretrained
from pianomime.learn.imitation.samples import Samples
from pianomime.learn.runs.trainer import train_network
from pianomime.policies.features import action_reference, to_world_frame
from pianomime.policies.sampler import Sampler
from pianomime.progress import Progress, no_progress
from pianomime.world.hand import by_actuator

_NORMALIZER_SAMPLES = 20_000
"""Training samples that the normalizers are fitted to."""
_VALIDATION_SAMPLES = 1024
"""Samples of the validation songs on which errors are measured."""


def train_policy(
    name: str,
    config: PolicyConfig,
    out: Path,
    demonstrations: Path | None,
    experts: Sequence[Path],
    goal: Path | None,
    progress: Progress = no_progress,
    pretrained: Path | None = None,
) -> Path:
    """Train a policy, or resume its training.

    Args:
        name: of the policy.
        config: how to train it.
        out: folder; `NAME.onnx` is the result, and `NAME` holds the training.
        demonstrations: what high levels learn from, see `demonstration_dataset`; `experts` if None.
        experts: data sets that all others learn from, see `trajectory_dataset`.
        goal: folder of the goal encoder, where goals are encoded and nothing is pretrained.
        progress: called as the data are read, and with the updates that were done.
        pretrained: policy file whose weights are trained on, with its normalizers and its goal
            encoder; random weights if None.

    Returns:
        The ONNX file.

    Raises:
        InputError: data are missing or cannot be used, or the folder holds another training.
        OSError: a file cannot be read or written.
    """
    check_sources(name, config, demonstrations, experts)
    result = out / f"{name}.onnx"
    if pretrained is not None and result.resolve() == pretrained.resolve():
        raise InputError(f"{pretrained}: would be replaced; name another place for the result")
    before = None if pretrained is None else check_pretrained(config, pretrained)
    encoder = None
    if config.goal_encoding == "sdf":
        # That of a pretrained policy is in its file, as are its normalizers.
        encoder = _goal_encoder(name, goal) if pretrained is None else _blank_encoder()
    progress("reading", 0, 0)
    dataset = _dataset(config, demonstrations, experts)
    if len(set(dataset.song_id.tolist())) < 2:
        raise InputError("two songs at least are needed, one of them for validation")
    train, validation = (Samples.of(part, config) for part in dataset.split())
    seed = config.trainer.seed
    sample = train.draw(np.random.default_rng(seed), _NORMALIZER_SAMPLES)
    torch.manual_seed(seed)
    shapes = {key: value.shape[1:] for key, value in sample.items()}
    network = PolicyNetwork(config, shapes, encoder)
    settings = dataclasses.asdict(config)
    if pretrained is None:
        network.fit_normalizers(sample)
    else:
        load_pretrained(network, pretrained)
        settings["pretrained"] = _digest(network)
    # The trainer adds its own.
    del settings["trainer"]
    digest = dataset.digest()
    out.mkdir(parents=True, exist_ok=True)
    train_network(
        out / name,
        network,
        lambda module, batch: module(batch),
        train.draw,
        config.trainer,
        _evaluation(validation),
        progress,
        {
            "policy": name,
            **settings,
            "data": digest,
            "goal_encoder": None if encoder is None else _digest(encoder),
        },
        held_out=validation.evenly(_VALIDATION_SAMPLES),
    )
    progress("exporting", 0, 0)
    info = policy_info(network, name, digest)
    if before is not None:
        info = dataclasses.replace(info, licence=before.licence)
    export_policy(network, info, result)
    return result


def _goal_encoder(name: str, goal: Path | None) -> torch.nn.Module:
    """The goal encoder that a policy needs.

    Raises:
        InputError: there is none, or it is damaged or of another version.
    """
    if goal is None:
        raise InputError(f"{name} needs a goal encoder (--goal): `pianomime train-goal`")
    from pianomime.learn.goal.training import load_encoder

    return load_encoder(goal)


def _blank_encoder() -> torch.nn.Module:
    """A goal encoder whose weights are still to be loaded; they are not trained."""
    from pianomime.learn.goal.autoencoder import GoalEncoder

    return GoalEncoder().requires_grad_(False)


def _dataset(config: PolicyConfig, demonstrations: Path | None, experts: Sequence[Path]) -> Dataset:
    if demonstrations is not None:
        return demonstration_dataset(demonstrations)
    if config.level == "high":
        return trajectory_dataset(experts, DEMONSTRATION_COLUMNS)
    return trajectory_dataset(experts, TRAJECTORY_COLUMNS, "ik" if config.residual else "")


def _digest(module: torch.nn.Module) -> str:
    """Hash that identifies the weights."""
    digest = hashlib.sha256()
    for weight in module.state_dict().values():
        digest.update(weight.numpy().tobytes())
    return digest.hexdigest()[:16]


def _evaluation(validation: Samples) -> Callable[[torch.nn.Module], dict[str, float]]:
    """Measures the mean error of the first frame of chunks, in songs kept from training.

    For high levels in millimetres, beside the error of fingertips that stay where they are; for
    others in radians, beside the error of the reference: the held pose, or the base controller.
    """
    sample, config = validation.evenly(_VALIDATION_SAMPLES), validation.config
    observation = {key: sample[key] for key in ("goal", "frames", "vector")}
    reference = action_reference(config.level, config.residual, sample["vector"])
    target = (sample["target"] + reference)[:, 0]

    def evaluate(module: torch.nn.Module) -> dict[str, float]:
        assert isinstance(module, PolicyNetwork)
        policy = torch_policy(module, sampler=Sampler())
        action = policy.act(observation, np.random.default_rng(0))[:, 0]
        if config.level == "high":
            return {
                "validation/fingertip_error_mm": _distance_mm(action, target),
                "validation/fingertip_error_mm_if_still": _distance_mm(sample["vector"], target),
            }
        # Radians of fingers and wrists alone: forearms slide in metres.
        turns = by_actuator(1.0, 1.0, 0.0) > 0
        return {
            "validation/control_error_rad": float(np.abs(action - target)[:, turns].mean()),
            "validation/control_error_rad_of_reference": float(
                np.abs(reference[:, 0] - target)[:, turns].mean()
            ),
        }

    return evaluate


def _distance_mm(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """Mean distance [mm] along x and along y, of points (B, 36) relative to their wrists."""
    points = [to_world_frame(each.reshape(-1, 2, 6, 3)) for each in (one, other)]
    return float(np.abs(points[0] - points[1])[..., :2].mean() * 1e3)
