"""A picture of the goal codes: whether similar goals have similar codes."""

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
"""Goals in the scatter plot."""
_COMPARED = 600
"""Goals that are compared in pairs."""


@torch.no_grad()
def draw_codes(encoder: GoalEncoder, goal: torch.Tensor, path: Path) -> None:
    """Write the picture.

    Left: the codes along their two principal axes, coloured by the mean key of their goals. Right:
    the distance of codes over the Chamfer distance of their goals, in pairs.

    Args:
        encoder: trained.
        goal: (N, 88) goals that it was not trained on; silence is left out.
        path: of the .png file.

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
    figure.colorbar(dots, ax=left, label="mean key of the goal")
    left.set(title="codes of validation goals", xlabel="first axis", ylabel="second axis")
    right.hexbin(apart.numpy() * 100, codes.numpy(), gridsize=50, bins="log")
    right.set(title="pairs of goals", xlabel="distance of goals [cm]", ylabel="distance of codes")
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=120)
