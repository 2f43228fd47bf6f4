"""Picture of the piano roll: notes played, missed and wrong, coloured by hand."""

from __future__ import annotations

import os

import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pianomime.palette import LIGHT, Theme
from pianomime.plan import LEFT, RIGHT
from pianomime.players.performance import Performance
from pianomime.report.roll import Layer, Lines, corners, legend, runs, save, sheet

_NOBODY = 2
"""Index, after LEFT and RIGHT, of the colour of notes that were assigned to no hand."""
_HEAD = 1.05  # [inches]


def draw(performance: Performance, path: str | os.PathLike[str], theme: Theme = LIGHT) -> None:
    """Draw the piano roll of a performance into a PNG file.

    Args:
        performance: the performance to draw.
        path: the file to write.
        theme: the colours.
    """
    lines = Lines.of(performance)
    metrics = performance.metrics()
    figure = sheet(
        _HEAD + lines.height,
        performance.score.title,
        f"F1 {metrics['f1']:.3f}    precision {metrics['precision']:.3f}    "
        f"recall {metrics['recall']:.3f}    onset F1 {metrics['onset_f1']:.3f}",
        theme,
    )
    legend(figure, _entries(performance, theme), theme)
    layers = _layers(performance, theme)
    pedal = corners(runs(performance.pedal[:, None]))
    pedal[..., 1] += lines.low - 3.1  # a strip below the keys
    layers.append(Layer(pedal, theme.hands[_NOBODY], theme.hands[_NOBODY]))
    lines.draw(figure, layers, theme)
    save(figure, path, theme)


def _layers(performance: Performance, theme: Theme) -> list[Layer]:
    wanted = performance.score.roll()
    hand = _hand_of_cell(performance)
    layers = []
    for whose in (LEFT, RIGHT, _NOBODY):
        mine = hand == whose
        missed, played = runs(wanted & mine), runs(wanted & performance.pressed & mine)
        layers.append(Layer(corners(missed), theme.wanted[whose], theme.hands[whose]))
        layers.append(Layer(corners(played), theme.hands[whose], theme.hands[whose]))
    wrong = runs(performance.pressed & ~wanted)
    layers.append(Layer(corners(wrong), theme.wrong, theme.wrong))
    return layers


def _hand_of_cell(performance: Performance) -> NDArray[np.int8]:
    """(T, 88) Hand that each note was assigned to, `_NOBODY` where there is none."""
    hand = np.full(performance.pressed.shape, _NOBODY, np.int8)
    if performance.plan is not None:
        score = performance.score
        for (first, stop), key, whose in zip(
            score.note_frames(), score.key, performance.plan.note_hand, strict=True
        ):
            if whose in (LEFT, RIGHT):
                hand[first:stop, key] = whose
    return hand


def _entries(performance: Performance, theme: Theme) -> list[Artist]:
    """Entries of the legend."""

    def box(colour: str, edge: str, label: str) -> Patch:
        return Patch(facecolor=colour, edgecolor=edge, linewidth=0.9, label=label)

    entries: list[Artist] = [
        box(theme.hands[LEFT], theme.hands[LEFT], "left hand"),
        box(theme.hands[RIGHT], theme.hands[RIGHT], "right hand"),
        box(theme.wanted[LEFT], theme.hands[LEFT], "missed, left"),
        box(theme.wanted[RIGHT], theme.hands[RIGHT], "missed, right"),
        box(theme.wrong, theme.wrong, "wrong"),
    ]
    if performance.plan is None or performance.dropped_notes:
        entries.append(box(theme.wanted[_NOBODY], theme.hands[_NOBODY], "assigned to no hand"))
    if performance.pedal.any():
        entries.append(Line2D([], [], color=theme.hands[_NOBODY], linewidth=4, label="pedal"))
    if len(performance.blow_ups):
        entries.append(
            Line2D([], [], color=theme.wrong, linewidth=1, linestyle=":", label="physics broke")
        )
    return entries
