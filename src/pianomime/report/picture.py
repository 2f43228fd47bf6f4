"""The piano roll: what was wanted, played, missed and wrong, coloured by hand."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pianomime.performance import FRAMES_A_SECOND, Performance
from pianomime.plan import LEFT, RIGHT

_ROW_SECONDS = 16.0
"""Music on a line at most: semiquavers at a quick tempo can still be told apart."""
_MOST_ROWS = 24
"""More music than fits on these lines (over 6 minutes) is packed more densely."""
_FEWEST_KEYS = 36
_LOWEST_MIDI = 21  # key 0 is A0
_BLACK = (1, 3, 6, 8, 10)  # within an octave from C
_NOBODY = 2
"""Index, beside LEFT and RIGHT, of the colour of notes that no hand was given."""


@dataclass(frozen=True)
class Theme:
    """Colours of a picture; the hands', left, right and neither, are those of the film."""

    paper: str
    black_keys: str
    lines: str
    text: str
    faint_text: str
    hands: tuple[str, str, str]
    wanted: tuple[str, str, str]
    wrong: str


LIGHT = Theme(
    paper="#ffffff",
    black_keys="#f5f6f8",
    lines="#dde1e7",
    text="#1c2430",
    faint_text="#6b7686",
    hands=("#2467c9", "#e58a00", "#8a94a3"),
    wanted=("#cadcf6", "#fbe2b8", "#dfe3e8"),
    wrong="#d3124a",
)
DARK = Theme(
    paper="#171b21",
    black_keys="#12151a",
    lines="#2c333d",
    text="#e8ecf2",
    faint_text="#8d98a8",
    hands=("#5b9bf0", "#f2a232", "#7d8795"),
    wanted=("#22395c", "#503a16", "#343b45"),
    wrong="#ff4d7d",
)


def draw(performance: Performance, path: str | os.PathLike[str], theme: Theme = LIGHT) -> None:
    """Draw the piano roll of a performance into a PNG file.

    Args:
        performance: what to draw.
        path: the file to write.
        theme: its colours.
    """
    seconds = performance.song_seconds
    # A score of 30 s has 601 frames; the silent last one is not worth a line.
    rows = min(_MOST_ROWS, max(1, math.ceil((seconds - 0.1) / _ROW_SECONDS)))
    row_seconds = math.ceil(max((seconds - 0.1) / rows, 1.0))
    low, high = _key_range(performance)
    row_height = 0.6 + 0.052 * (high - low)
    head, foot = 1.05, 0.2
    height = head + rows * row_height + foot
    figure = Figure(figsize=(12.0, height), dpi=110, facecolor=theme.paper)
    boxes = _boxes(performance, theme)
    pedal = _corners(performance.pedal[:, None])
    pedal[..., 1] += low - 3.1  # a strip below the keys
    boxes.append((pedal, theme.hands[_NOBODY], theme.hands[_NOBODY]))
    for row in range(rows):
        bottom = height - head - (row + 1) * row_height + 0.35
        axes = figure.add_axes(
            (0.055, bottom / height, 0.925, (row_height - 0.35) / height), facecolor=theme.paper
        )
        _paper(axes, low, high, theme)
        begin, end = row * row_seconds, (row + 1) * row_seconds
        for corners, colour, edge in boxes:
            here = corners[(corners[:, 0, 0] < end) & (corners[:, 2, 0] > begin)]
            rectangles = PolyCollection(
                list(here), facecolors=colour, edgecolors=edge, linewidths=0.7
            )
            axes.add_collection(rectangles)
            rectangles.set_zorder(3)  # above the line of each C
        for frame in performance.blow_ups:
            axes.axvline(frame / FRAMES_A_SECOND, color=theme.wrong, linewidth=0.8, linestyle=":")
        axes.set_xlim(begin, end)
        axes.set_ylim(low - 3.2, high + 1)
    figure.axes[-1].set_xlabel("seconds", color=theme.faint_text, fontsize=9)
    _heading(figure, performance, height, theme)
    figure.savefig(path, format="png", facecolor=theme.paper)


def _key_range(performance: Performance) -> tuple[int, int]:
    """Lowest and one past the highest key to show."""
    used = np.flatnonzero(performance.pressed.any(axis=0) | performance.score.roll().any(axis=0))
    low, high = (int(used[0]), int(used[-1]) + 1) if len(used) else (40, 40)
    middle = (low + high) / 2
    low = max(0, min(low - 2, int(middle - _FEWEST_KEYS / 2)))
    high = min(88, max(high + 2, low + _FEWEST_KEYS))
    return low, high


def _runs(cells: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(M, 3) first frame, end frame and column of each unbroken run of true cells (T, K)."""
    padded = np.pad(cells, ((1, 1), (0, 0))).astype(np.int8).T
    column, start = np.nonzero(np.diff(padded) == 1)
    _, end = np.nonzero(np.diff(padded) == -1)
    return np.stack([start, end, column], axis=1)


def _boxes(performance: Performance, theme: Theme) -> list[tuple[NDArray[np.float64], str, str]]:
    """Rectangles, their colour and that of their edge, from the bottom layer to the top one."""
    wanted = performance.score.roll()
    hand = _hand_of_cell(performance)
    boxes = []
    for whose in (LEFT, RIGHT, _NOBODY):
        mine = hand == whose
        boxes.append((_corners(wanted & mine), theme.wanted[whose], theme.hands[whose]))
        played = wanted & performance.pressed & mine
        boxes.append((_corners(played), theme.hands[whose], theme.hands[whose]))
    boxes.append((_corners(performance.pressed & ~wanted), theme.wrong, theme.wrong))
    return boxes


def _corners(cells: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(M, 4, 2) corners [s, keys] of the rectangle of each unbroken run of true cells (T, 88)."""
    runs = _runs(cells)
    start, end = runs[:, 0] / FRAMES_A_SECOND, runs[:, 1] / FRAMES_A_SECOND
    low, high = runs[:, 2] + 0.08, runs[:, 2] + 0.92
    corners = np.stack([start, low, start, high, end, high, end, low], axis=1)
    return corners.reshape(-1, 4, 2)


def _hand_of_cell(performance: Performance) -> NDArray[np.int8]:
    """(T, 88) the hand that a note was given to, `_NOBODY` where there is none."""
    hand = np.full(performance.pressed.shape, _NOBODY, np.int8)
    if performance.plan is not None:
        score = performance.score
        for (first, stop), key, whose in zip(
            score.note_frames(), score.key, performance.plan.note_hand, strict=True
        ):
            if whose in (LEFT, RIGHT):
                hand[first:stop, key] = whose
    return hand


def _paper(axes: Axes, low: int, high: int, theme: Theme) -> None:
    """Stripes for black keys, a line and a label for every C."""
    for key in range(low, high):
        if (key + _LOWEST_MIDI) % 12 in _BLACK:
            axes.axhspan(key, key + 1, color=theme.black_keys, linewidth=0)
    octaves = [key for key in range(low, high) if (key + _LOWEST_MIDI) % 12 == 0]
    for key in octaves:
        axes.axhline(key, color=theme.lines, linewidth=0.8)
    axes.set_yticks(
        [key + 0.5 for key in octaves], [f"C{(key + _LOWEST_MIDI) // 12 - 1}" for key in octaves]
    )
    axes.tick_params(colors=theme.faint_text, labelsize=8.5, length=0)
    axes.xaxis.grid(visible=True, color=theme.lines, linewidth=0.6)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _heading(figure: Figure, performance: Performance, height: float, theme: Theme) -> None:
    """Title, one line of numbers, legend."""
    metrics = performance.metrics()
    title = performance.score.title
    figure.text(
        0.055, 1 - 0.34 / height, title if len(title) <= 48 else f"{title[:47]}…",
        color=theme.text, fontsize=15, fontweight="bold", va="center",
    )  # fmt: skip
    figure.text(
        0.98, 1 - 0.34 / height,
        f"F1 {metrics['f1']:.3f}    precision {metrics['precision']:.3f}    "
        f"recall {metrics['recall']:.3f}    onset F1 {metrics['onset_f1']:.3f}",
        color=theme.faint_text, fontsize=10.5, va="center", ha="right",
    )  # fmt: skip

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
        entries.append(box(theme.wanted[_NOBODY], theme.hands[_NOBODY], "given to no hand"))
    if performance.pedal.any():
        entries.append(Line2D([], [], color=theme.hands[_NOBODY], linewidth=4, label="pedal"))
    if len(performance.blow_ups):
        entries.append(
            Line2D([], [], color=theme.wrong, linewidth=1, linestyle=":", label="physics broke")
        )
    figure.legend(
        handles=entries, loc="center left", bbox_to_anchor=(0.047, 1 - 0.7 / height),
        ncols=len(entries), frameon=False, labelcolor=theme.text, fontsize=9.5,
        handlelength=1.3, handleheight=0.8, columnspacing=1.6, handletextpad=0.5,
    )  # fmt: skip
