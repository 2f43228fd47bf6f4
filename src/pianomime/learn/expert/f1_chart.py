"""Bar chart of the F1 of many experts, sorted (paper, figure 8)."""

from __future__ import annotations

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pianomime.files import atomic
from pianomime.palette import LIGHT
from pianomime.workers import Row


def draw_f1_chart(rows: list[Row], path: Path) -> None:
    """Draw the F1 of all experts that did not fail, the best first.

    Args:
        rows: one for each song, with `f1` or `error`.
        path: of the picture (.png), which appears only when complete.
    """
    f1 = sorted((row["f1"] for row in rows if "error" not in row), reverse=True)
    figure = Figure(figsize=(8, 3), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.bar(range(1, len(f1) + 1), f1, width=1.0, color=LIGHT.hands[0], edgecolor="white")
    if f1:
        mean = sum(f1) / len(f1)
        axes.axhline(mean, color=LIGHT.wrong, linewidth=1, label=f"mean {mean:.3f}")
        axes.legend(loc="lower left")
    axes.set(xlabel="experts, best first", ylabel="F1", ylim=(0, 1), xlim=(0.5, len(f1) + 0.5))
    with atomic(path) as temporary:
        figure.savefig(temporary, dpi=120)
