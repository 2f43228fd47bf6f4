"""Picture and data of a diagnosis: a piano roll coloured by cause, and a bar for each cause."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from pianomime.evaluation.diagnose import Cause, Diagnosis, Fault, Total, diagnose, totals
from pianomime.palette import LIGHT
from pianomime.players.performance import Performance
from pianomime.report.roll import (
    LEFT_EDGE,
    RIGHT_EDGE,
    Layer,
    Lines,
    corners,
    runs,
    save,
    sheet,
)

DIAGNOSIS_FILES = ("diagnosis.json", "diagnosis.png")
"""All files that `write_diagnosis` writes."""

_THEME = LIGHT
# Cold colours for missed keys, warm ones for wrong keys.
_COLOURS = {
    Cause.NOT_PLANNED: "#1f3a93",
    Cause.PLANNED_ASIDE: "#7a5cc9",
    Cause.BESIDE: "#2f7fe0",
    Cause.ABOVE: "#12a5c4",
    Cause.LATE: "#14906b",
    Cause.SHALLOW: "#6fbf4b",
    Cause.PLANNED_WRONG: "#7d4427",
    Cause.EARLY: "#f2b705",
    Cause.RELEASED_LATE: "#f07818",
    Cause.NEIGHBOUR: "#d3124a",
    Cause.IDLE: "#e87fa0",
    Cause.NO_TIP: "#a0559a",
    Cause.BROKEN: "#1c2430",
}
_HEAD, _BAR, _GAP = 0.75, 0.27, 0.55  # [inches]


def write_diagnosis(performances: Sequence[Performance], folder: Path) -> list[Diagnosis]:
    """Diagnose performances and write `DIAGNOSIS_FILES`.

    Args:
        performances: performances to diagnose; the picture of more than one has no piano roll.
        folder: an existing folder for the files.

    Returns:
        A diagnosis of each performance.

    Raises:
        ValueError: a performance has no plan.
    """
    diagnoses = [diagnose(performance) for performance in performances]
    content = {
        "causes": [asdict(total) for total in totals(diagnoses)],
        "songs": [asdict(diagnosis) for diagnosis in diagnoses],
    }
    (folder / "diagnosis.json").write_text(
        json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    _draw(performances, diagnoses, folder / "diagnosis.png")
    return diagnoses


def _draw(performances: Sequence[Performance], diagnoses: Sequence[Diagnosis], path: Path) -> None:
    sums = totals(diagnoses)
    bars = _BAR * max(len(sums), 1)
    height = _HEAD + bars + _GAP
    lines = None
    if len(performances) == 1:
        lines = Lines.of(performances[0])
        height += lines.height
    wanted = max(sum(diagnosis.wanted for diagnosis in diagnoses), 1)
    missed, wrong = (
        sum(total.frames for total in sums if total.missed == kind) / wanted
        for kind in (True, False)
    )
    songs = diagnoses[0].song if lines else f"{len(diagnoses)} songs"
    figure = sheet(
        height,
        f"Why: {songs}",
        f"of the key-frames wanted:  missed {missed:.1%}    wrong {wrong:.1%}",
        _THEME,
    )
    _draw_bars(figure, sums, bars)
    if lines:
        layers = _layers(performances[0], diagnoses[0].faults)
        lines.draw(figure, layers, _THEME)
    save(figure, path, _THEME)


def _draw_bars(figure: Figure, sums: Sequence[Total], high: float) -> None:
    """Draw one bar for each cause, which is also the legend of the piano roll."""
    height = figure.get_figheight()
    names = 0.22
    axes = figure.add_axes(
        (
            LEFT_EDGE + names, 1 - (_HEAD + high) / height,
            RIGHT_EDGE - LEFT_EDGE - names - 0.12, high / height,
        ),
        facecolor=_THEME.paper,
    )  # fmt: skip
    places = np.arange(len(sums))
    axes.barh(
        places,
        [total.share for total in sums],
        height=0.66,
        color=[_COLOURS[total.cause] for total in sums],
    )
    for place, total in zip(places, sums, strict=True):
        notes = f"{total.notes} note{'s' * (total.notes != 1)}"
        axes.annotate(
            f"{total.share:.1%}   {notes}", (total.share, place), (6, 0),
            textcoords="offset points", va="center", color=_THEME.faint_text, fontsize=9.5,
        )  # fmt: skip
    axes.set_yticks(
        places, [f"{'missed' if total.missed else 'wrong'}: {total.cause}" for total in sums]
    )
    axes.tick_params(axis="y", colors=_THEME.text, labelsize=9.5, length=0)
    axes.set_xticks([])
    axes.set_xlim(0, max((total.share for total in sums), default=1.0))
    axes.set_ylim(max(len(sums), 1) - 0.5, -0.5)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _layers(performance: Performance, faults: Sequence[Fault]) -> list[Layer]:
    """Correct keys in grey, every fault in the colour of its cause."""
    right = runs(performance.score.roll() & performance.pressed)
    layers = [Layer(corners(right), _THEME.wanted[2], _THEME.wanted[2])]
    for cause, colour in _COLOURS.items():
        spans = [(f.first, f.first + f.frames, f.key) for f in faults if f.cause == cause]
        layers.append(Layer(corners(np.array(spans, int).reshape(-1, 3)), colour, colour))
    return layers
