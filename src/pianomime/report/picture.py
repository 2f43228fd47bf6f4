"""Picture of the piano roll: notes played and missed, coloured by hand, and phantom notes."""

from __future__ import annotations

import os
from dataclasses import asdict

import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pianomime.evaluation.measures import MUSIC
from pianomime.music import Score, match_notes
from pianomime.music.key_time import strikes
from pianomime.palette import LIGHT, Theme
from pianomime.plan import LEFT, RIGHT
from pianomime.players.performance import Performance
from pianomime.report.roll import Layer, Lines, boxes, legend, save, sheet

_NOBODY = 2
"""Index, after LEFT and RIGHT, of the colour of notes that were assigned to no hand."""
_HEAD = 1.05  # [inches]
_REMARK = [
    measure
    for measure in MUSIC
    if measure.name in ("music.note_f1_50", "music.velocity_f1", "music.phantoms_per_minute")
]


def draw(performance: Performance, path: str | os.PathLike[str], theme: Theme = LIGHT) -> None:
    """Draw the piano roll of a performance, in its true times, into a PNG file.

    Args:
        performance: the performance to draw.
        path: the file to write.
        theme: the colours.
    """
    lines = Lines.of(performance)
    row = {"music": asdict(performance.music())}
    remark = "    ".join(f"{measure.label}: {measure.show(row)}" for measure in _REMARK)
    figure = sheet(_HEAD + lines.height, performance.score.title, remark, theme)
    legend(figure, _entries(performance, theme), theme)
    layers = _layers(performance, theme)
    # A strip below the keys.
    pedal = performance.pedal_times
    strip = boxes(np.full(len(pedal), lines.low - 3.1), pedal[:, 0], pedal[:, 1])
    layers.append(Layer(strip, theme.hands[_NOBODY], theme.hands[_NOBODY]))
    lines.draw(figure, layers, theme)
    save(figure, path, theme)


def _layers(performance: Performance, theme: Theme) -> list[Layer]:
    """Wanted notes below what was played of them; over it notes without a strike, and phantoms."""
    wanted, played = strikes(performance.score), strikes(performance.played())
    matched = match_notes(wanted, played)
    hand = _hand_of_note(performance)
    struck = np.zeros(len(wanted), bool)
    struck[matched.wanted] = True
    phantom = np.ones(len(played), bool)
    phantom[matched.played] = False

    def layer(score: Score, notes: NDArray[np.int64], face: str, edge: str) -> Layer:
        return Layer(boxes(score.key[notes], score.onset[notes], score.offset[notes]), face, edge)

    below, heard, over = [], [], []
    for whose in (LEFT, RIGHT, _NOBODY):
        light, dark = theme.wanted[whose], theme.hands[whose]
        mine = hand == whose
        below.append(layer(wanted, np.flatnonzero(mine & struck), light, dark))
        heard.append(layer(played, matched.played[mine[matched.wanted]], dark, dark))
        over.append(layer(wanted, np.flatnonzero(mine & ~struck), light, dark))
    return [*below, *heard, *over, layer(played, np.flatnonzero(phantom), theme.wrong, theme.wrong)]


def _hand_of_note(performance: Performance) -> NDArray[np.int64]:
    """(N,) Hand that each note was assigned to, `_NOBODY` where there is none."""
    if performance.plan is None:
        return np.full(len(performance.score), _NOBODY)
    hand = performance.plan.note_hand
    return np.where(np.isin(hand, (LEFT, RIGHT)), hand, _NOBODY)


def _entries(performance: Performance, theme: Theme) -> list[Artist]:
    """Entries of the legend."""

    def box(colour: str, edge: str, label: str) -> Patch:
        return Patch(facecolor=colour, edgecolor=edge, linewidth=0.9, label=label)

    entries: list[Artist] = [
        box(theme.hands[LEFT], theme.hands[LEFT], "left hand"),
        box(theme.hands[RIGHT], theme.hands[RIGHT], "right hand"),
        box(theme.wanted[LEFT], theme.hands[LEFT], "missed, left"),
        box(theme.wanted[RIGHT], theme.hands[RIGHT], "missed, right"),
        box(theme.wrong, theme.wrong, "phantom"),
    ]
    if performance.plan is None or performance.dropped_notes:
        entries.append(box(theme.wanted[_NOBODY], theme.hands[_NOBODY], "assigned to no hand"))
    if len(performance.pedal_times):
        entries.append(Line2D([], [], color=theme.hands[_NOBODY], linewidth=4, label="pedal"))
    if len(performance.blow_ups):
        entries.append(
            Line2D([], [], color=theme.wrong, linewidth=1, linestyle=":", label="physics broke")
        )
    return entries
