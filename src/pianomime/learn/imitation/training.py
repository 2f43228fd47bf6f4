"""Training of one stage of a generalist, from data to the file that is played."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.data.clips import EXPERT, HUMAN, Clips, expert_clips, human_clips
from pianomime.learn.data.samples import Windows
from pianomime.learn.imitation.config import PolicyConfig, check_stage
from pianomime.learn.imitation.export import export_stage, torch_policy
from pianomime.learn.imitation.network import Stage
from pianomime.learn.imitation.trainer import fit
from pianomime.learn.runs.tell import Tell
from pianomime.policies.features import base, to_world
from pianomime.policies.sampler import Sampler
from pianomime.world.hand import by_actuator

_SCALED_BY = 20_000
"""Samples, drawn as those that are learned from, from which scales are taken."""
_MEASURED = 1024
"""Samples of songs that were kept from training, by which it is seen how well they are told."""


def train_policy(
    name: str,
    config: PolicyConfig,
    out: Path,
    demonstrations: Path | None,
    experts: Sequence[Path],
    goal: Path | None,
    tell: Tell | None = None,
) -> Path:
    """Train a stage, or go on where its training was.

    Args:
        name: of the stage.
        config: how.
        out: folder for it; `NAME.onnx` is the result, and `NAME` holds the training.
        demonstrations: what high levels learn from, see `human_clips`; `experts` if None.
        experts: what all others learn from, see `expert_clips`.
        goal: folder of the goal encoder, where it is used.
        tell: told how far it is.

    Returns:
        The result.

    Raises:
        InputError: data are missing or cannot be used, or the folder holds another training.
        OSError: a file cannot be read or written.
    """
    check_stage(config)
    clips = _data(config, demonstrations, experts)
    encoder = None
    if config.code == "sdf":
        if goal is None:
            raise InputError(f"{name} needs a goal encoder (--goal): `pianomime train-goal`")
        from pianomime.learn.goal.training import load_encoder

        encoder = load_encoder(goal)
    if len(set(clips.song.tolist())) < 2:
        raise InputError("two songs at least are needed, one of them to measure on")
    learned, held = (Windows.of(some, config) for some in clips.split())
    sample = learned.draw(np.random.default_rng(config.fit.seed), _SCALED_BY)
    torch.manual_seed(config.fit.seed)
    stage = Stage(config, {key: value.shape[1:] for key, value in sample.items()}, encoder)
    stage.fit_scales(sample)
    about = {
        "stage": name,
        **dataclasses.asdict(config),
        "data": clips.fingerprint(),
        "goal_encoder": None if encoder is None else _digest(encoder),
    }
    out.mkdir(parents=True, exist_ok=True)
    fit(
        out / name,
        stage,
        lambda network, batch: network(batch),
        learned.draw,
        config.fit,
        _measure(held),
        tell,
        about,
    )
    result = out / f"{name}.onnx"
    export_stage(stage, name, result)
    return result


def _data(config: PolicyConfig, demonstrations: Path | None, experts: Sequence[Path]) -> Clips:
    if demonstrations is not None:
        if config.level != "high" or experts:
            raise InputError("--demonstrations are for high levels, and instead of --experts")
        return human_clips(demonstrations)
    if not experts:
        raise InputError("it needs --experts, data sets made by `pianomime collect-dagger`")
    if config.level == "high":
        return expert_clips(experts, HUMAN)
    return expert_clips(experts, EXPERT, "ik" if config.prior else "")


def _digest(module: torch.nn.Module) -> str:
    """Tells weights from others."""
    digest = hashlib.sha256()
    for weight in module.state_dict().values():
        digest.update(weight.numpy().tobytes())
    return digest.hexdigest()[:16]


def _measure(held: Windows) -> Callable[[torch.nn.Module], dict[str, float]]:
    """How far off the first frame of chunks is, in songs that were kept from training.

    Of high levels in millimetres, beside that of fingertips which stay where they are; of others in
    radians, beside that of a policy which says nothing: holds the pose, or adds nothing to a prior.
    """
    sample, config = held.some(_MEASURED), held.config
    given = {key: sample[key] for key in ("goal", "frames", "vector")}
    relative_to = base(config.level, config.prior, sample["vector"])
    true = (sample["target"] + relative_to)[:, 0]

    def measure(module: torch.nn.Module) -> dict[str, float]:
        assert isinstance(module, Stage)
        policy = torch_policy(module, sampler=Sampler())
        said = policy.say(given, np.random.default_rng(0))[:, 0]
        if config.level == "high":
            return {
                "unseen/off_mm": _apart(said, true),
                "unseen/off_mm_if_still": _apart(sample["vector"], true),
            }
        # Radians of fingers and wrists alone: forearms slide in metres.
        turned = by_actuator(1.0, 1.0, 0.0) > 0
        return {
            "unseen/off": float(np.abs(said - true)[:, turned].mean()),
            "unseen/off_without": float(np.abs(relative_to[:, 0] - true)[:, turned].mean()),
        }

    return measure


def _apart(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """Mean distance [mm], along x and along y, of points (B, 36) told from their wrists."""
    off = [to_world(told.reshape(-1, 2, 6, 3)) for told in (one, other)]
    return float(np.abs(off[0] - off[1])[..., :2].mean() * 1e3)
