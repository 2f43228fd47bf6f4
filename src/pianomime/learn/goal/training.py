"""Training of the goal autoencoder (paper, algorithm 2), and what it came to."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy.stats import spearmanr
from torch import Tensor, nn

from pianomime.errors import InputError
from pianomime.learn.goal.autoencoder import GoalAutoencoder, GoalEncoder
from pianomime.learn.goal.config import GoalConfig, check_goal
from pianomime.learn.goal.goals import GoalDraw, Goals, GoalSplit, read_goals
from pianomime.learn.goal.picture import draw_codes
from pianomime.learn.goal.sdf import KEYBOARD, QUERY_HIGH, QUERY_LOW, chamfer, distance
from pianomime.learn.imitation.trainer import Batch, fit, load_arrays
from pianomime.learn.runs.safetensors_file import read_tensors, write_tensors
from pianomime.learn.runs.tell import Tell

_RESULT = "goal.safetensors"
_VERSION = 1
_STANDARD = 20_000
"""Goals from which mean and deviation of the codes are taken."""
_MEASURED = 4_000
"""Unseen goals on which the reconstruction is measured."""
_COMPARED = 600
"""Unseen goals whose distances from each other are compared."""


@dataclass(frozen=True)
class GoalFigures:
    """How good an encoder is, on goals of files that it has not seen.

    Attributes:
        error_mm: mean error of the decoded distance [mm].
        near_codes: rank correlation of the distance of codes with that of goals, `chamfer`.
        near_keys: the same of the number of keys in which goals differ, for comparison.
    """

    error_mm: float
    near_codes: float
    near_keys: float


def train_goal(
    folders: Sequence[Path], out: Path, config: GoalConfig, tell: Tell, reading: Tell
) -> tuple[GoalFigures, GoalSplit]:
    """Train a goal autoencoder, or go on where its training was.

    Args:
        folders: of MIDI files.
        out: folder of the training and its result.
        config: how.
        tell: told how far the training is.
        reading: told how many files are read.

    Raises:
        InputError: there are no goals, or the folder holds another training.
        OSError: a file cannot be read or written.
    """
    check_goal(config)
    goals = read_goals(folders, config.unseen, reading)
    torch.manual_seed(config.fit.seed)
    module = GoalAutoencoder(config.octaves)
    about = {
        **dataclasses.asdict(config),
        "goals": goals.train.digest,
        "unseen_goals": goals.unseen.digest,
    }
    out.mkdir(parents=True, exist_ok=True)
    fit(out, module, _loss, GoalDraw(goals.train, config), config.fit, tell=tell, about=about)
    with torch.no_grad():
        module.encoder.standardise(_some(goals.train, _STANDARD))
    weights = {name: tensor.numpy() for name, tensor in module.state_dict().items()}
    write_tensors(out / _RESULT, weights, {"version": _VERSION, "octaves": config.octaves})
    draw_codes(module.encoder, _some(goals.unseen, _MEASURED), out / "codes.png")
    return measure(module, goals.unseen), goals


def load_encoder(folder: Path) -> GoalEncoder:
    """The encoder of a training, which learns no more.

    Raises:
        InputError: there is none, or it is damaged or of another version.
    """
    return load_autoencoder(folder).encoder.requires_grad_(False)


def load_autoencoder(folder: Path) -> GoalAutoencoder:
    """The result of a training, in eval mode.

    Raises:
        InputError: there is none, or it is damaged or of another version.
    """
    path = folder / _RESULT
    arrays, about = read_tensors(path)
    if about.get("version") != _VERSION or "octaves" not in about:
        raise InputError(f"{path}: not a goal autoencoder, or one of another version")
    module = GoalAutoencoder(about["octaves"])
    load_arrays(module, arrays, path)
    return module.eval()


@torch.no_grad()
def measure(module: GoalAutoencoder, unseen: Goals) -> GoalFigures:
    """How good an autoencoder is, on goals that it has not seen."""
    draw = np.random.default_rng(0)
    goal = _some(unseen, _MEASURED)
    query = torch.from_numpy(draw.uniform(QUERY_LOW, QUERY_HIGH, (len(goal), 16, 3))).float()
    off = module(goal, query) * KEYBOARD - distance(goal[:, None], query)
    few = goal[goal.any(dim=1)][:_COMPARED]
    pairs = torch.triu_indices(len(few), len(few), 1).unbind()
    apart = chamfer(few)[pairs]
    codes = torch.cdist(*(module.encoder(few),) * 2)[pairs]
    keys = torch.cdist(few, few, p=1)[pairs]
    return GoalFigures(
        float(off.abs().mean() * 1e3),
        float(spearmanr(apart, codes).statistic),
        float(spearmanr(apart, keys).statistic),
    )


def _loss(module: nn.Module, batch: Batch) -> Tensor:
    true = distance(batch["goal"][:, None], batch["query"]) / KEYBOARD
    return nn.functional.mse_loss(module(batch["goal"], batch["query"]), true)


def _some(goals: Goals, most: int) -> Tensor:
    """(n, 88) goals, evenly spread over those there are in an order by chance."""
    order = np.random.default_rng(0).permutation(len(goals))[:most]
    return torch.from_numpy(goals.keys(order).astype(np.float32))
