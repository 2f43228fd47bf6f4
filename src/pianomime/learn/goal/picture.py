"""A picture of the space of codes: whether goals that are near each other have codes that are."""

from __future__ import annotations

from pathlib import Path

import torch
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pianomime.files import atomic
from pianomime.keyboard import KEYS
from pianomime.learn.goal.autoencoder import GoalEncoder
from pianomime.learn.goal.sdf import chamfer

_SHOWN = 3000
_COMPARED = 600


@torch.no_grad()
def draw_codes(encoder: GoalEncoder, goal: torch.Tensor, path: Path) -> None:
    """Write the picture.

    Left, codes along their two principal axes, coloured by where on the keyboard their keys are;
    right, how far apart codes are over how far apart their goals are.

    Args:
        encoder: of goals.
        goal: (N, 88) goals that it has not learned from; silence is left out.
        path: of a .png file.

    Raises:
        OSError: it cannot be written.
    """
    goal = goal[goal.any(dim=1)][:_SHOWN]
    code = encoder(goal)
    middle = ((goal * torch.arange(KEYS)).sum(dim=1) / goal.sum(dim=1)).numpy()
    _, _, axes = torch.linalg.svd(code - code.mean(dim=0), full_matrices=False)
    place = ((code - code.mean(dim=0)) @ axes[:2].T).numpy()
    pairs = torch.triu_indices(*(len(goal[:_COMPARED]),) * 2, 1).unbind()
    apart = chamfer(goal[:_COMPARED])[pairs]
    codes = torch.cdist(code[:_COMPARED], code[:_COMPARED])[pairs]

    figure = Figure(figsize=(11, 4.5), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    dots = left.scatter(*place.T, c=middle, s=4, cmap="viridis")
    figure.colorbar(dots, ax=left, label="key in the middle of the goal")
    left.set(title="codes of unseen goals", xlabel="first axis", ylabel="second axis")
    right.hexbin(apart.numpy() * 100, codes.numpy(), gridsize=50, bins="log")
    right.set(title="pairs of goals", xlabel="goals apart [cm]", ylabel="codes apart")
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=120)
