"""Training of the goal autoencoder (paper, algorithm 2), and its evaluation."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy.stats import spearmanr
from torch import Tensor, nn

from pianomime.errors import InputError
from pianomime.learn.goal.autoencoder import GoalAutoencoder, GoalEncoder
from pianomime.learn.goal.config import RESULT, GoalConfig
from pianomime.learn.goal.goals import Goals, GoalSampler, GoalSplit, read_goals
from pianomime.learn.goal.picture import draw_codes
from pianomime.learn.goal.sdf import KEYBOARD_LENGTH, QUERY_HIGH, QUERY_LOW, chamfer, distance
from pianomime.learn.runs.safetensors_file import read_tensors, write_tensors
from pianomime.learn.runs.trainer import Batch, load_arrays, train_network
from pianomime.progress import Progress, no_progress
from pianomime.schema import Field, check_json

_VERSION = 1
_STANDARDIZED = 20_000
"""Training goals from which mean and standard deviation of the codes are computed."""
_VALIDATED = 4_000
"""Validation goals on which the error of the decoded distance is measured."""
_COMPARED = 600
"""Validation goals that are compared in pairs."""
_POINTS = 16
"""Points at which the distance to each validation goal is decoded."""


@dataclass(frozen=True)
class GoalMetrics:
    """How good a goal autoencoder is, on validation goals.

    Attributes:
        error_mm: mean error of the decoded distance [mm].
        code_correlation: rank correlation (Spearman) of the distances between codes with the
            Chamfer distances between goals.
        key_correlation: the same for the number of keys in which goals differ, as a baseline. Both
            are NaN where all distances are alike.
    """

    error_mm: float
    code_correlation: float
    key_correlation: float


def train_goal(
    folders: Sequence[Path], out: Path, config: GoalConfig, progress: Progress = no_progress
) -> tuple[GoalMetrics, GoalSplit]:
    """Train a goal autoencoder, or resume its training.

    Args:
        folders: of MIDI files.
        out: folder of the training and its result.
        config: how to train it.
        progress: called with the files that are read, then the updates that were done.

    Returns:
        The metrics on the validation goals, and all goals.

    Raises:
        InputError: there are no goals, or the folder holds another training.
        OSError: a file cannot be read or written.
    """
    goals = read_goals(folders, config.validation_share, progress)
    torch.manual_seed(config.trainer.seed)
    module = GoalAutoencoder(config.octaves)
    settings = dataclasses.asdict(config)
    # The trainer adds its own.
    del settings["trainer"]
    validation = _subset(goals.validation, _VALIDATED)
    out.mkdir(parents=True, exist_ok=True)
    train_network(
        out,
        module,
        _loss,
        GoalSampler(goals.train, config),
        config.trainer,
        progress=progress,
        depends_on={
            **settings,
            "goals": goals.train.digest,
            "validation_goals": goals.validation.digest,
        },
    )
    progress("evaluating", 0, 0)
    with torch.no_grad():
        module.encoder.standardize(_subset(goals.train, _STANDARDIZED))
    weights = {name: tensor.numpy() for name, tensor in module.state_dict().items()}
    write_tensors(out / RESULT, weights, {"version": _VERSION, "octaves": config.octaves})
    draw_codes(module.encoder, validation, out / "codes.png")
    return evaluate_autoencoder(module, validation), goals


def load_encoder(folder: Path) -> GoalEncoder:
    """The encoder of a finished training, with frozen weights.

    Raises:
        InputError: there is none, or it is damaged or of another version.
    """
    return load_autoencoder(folder).encoder.requires_grad_(False)


def load_autoencoder(folder: Path) -> GoalAutoencoder:
    """The autoencoder of a finished training, in eval mode.

    Raises:
        InputError: there is none, or it is damaged or of another version.
    """
    path = folder / RESULT
    arrays, metadata = read_tensors(path)
    if metadata.get("version") != _VERSION:
        raise InputError(f"{path}: not a goal autoencoder, or one of another version")
    try:
        check_json(metadata, {"version": Field("int"), "octaves": Field("int", (), 0, 12)})
    except InputError as error:
        raise InputError(f"{path}: damaged ({error})") from error
    module = GoalAutoencoder(metadata["octaves"])
    load_arrays(module, arrays, path)
    return module.eval()


@torch.no_grad()
def evaluate_autoencoder(module: GoalAutoencoder, goal: Tensor) -> GoalMetrics:
    """The metrics of an autoencoder on goals (N, 88) that it was not trained on."""
    rng = np.random.default_rng(0)
    points = rng.uniform(QUERY_LOW, QUERY_HIGH, (len(goal), _POINTS, 3))
    query = torch.from_numpy(points).float()
    error = module(goal, query) * KEYBOARD_LENGTH - distance(goal[:, None], query)
    few = goal[goal.any(dim=1)][:_COMPARED]
    pairs = torch.triu_indices(len(few), len(few), 1).unbind()
    goals_apart = chamfer(few)[pairs]
    codes_apart = torch.cdist(*(module.encoder(few),) * 2)[pairs]
    keys_apart = torch.cdist(few, few, p=1)[pairs]
    return GoalMetrics(
        float(error.abs().mean() * 1e3),
        _rank_correlation(goals_apart, codes_apart),
        _rank_correlation(goals_apart, keys_apart),
    )


def _rank_correlation(one: Tensor, other: Tensor) -> float:
    """Spearman's; NaN where one of them is all alike, as the distances of single notes may be."""
    if any(bool((row == row[:1]).all()) for row in (one, other)):
        return math.nan
    return float(spearmanr(one, other).statistic)


def _loss(module: nn.Module, batch: Batch) -> Tensor:
    target = distance(batch["goal"][:, None], batch["query"]) / KEYBOARD_LENGTH
    return nn.functional.mse_loss(module(batch["goal"], batch["query"]), target)


def _subset(goals: Goals, limit: int) -> Tensor:
    """(n, 88) goals as 0.0 and 1.0: a random subset with a fixed seed, in random order."""
    order = np.random.default_rng(0).permutation(len(goals))[:limit]
    return torch.from_numpy(goals.keys(order).astype(np.float32))
