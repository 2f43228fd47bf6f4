"""Common parts of pictures of piano rolls: lines of music, heading, legend."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, FRAME_RATE, KEYS, KEYS_PER_OCTAVE, LOWEST_PITCH, key_name
from pianomime.palette import Theme
from pianomime.players.performance import Performance

WIDTH = 12.0
"""[inches] Width of every picture."""
LEFT_EDGE, RIGHT_EDGE = 0.055, 0.98
"""Left and right end of lines of music and headings, as shares of the width."""

_ROW_SECONDS = 16.0
"""[s] Most music on one line, on which fast semiquavers are still separate."""
_MOST_ROWS = 24
"""Longer music, of more than 6 minutes, is drawn more densely on this many lines."""
_FEWEST_KEYS = 3 * KEYS_PER_OCTAVE
"""Keys that a line shows at least."""
_FOOT = 0.2  # [inches]
_BETWEEN = 0.2
"""[inches] between title and remark at least."""
_POINTS = 72
"""In an inch."""
_MOST_LETTERS = 100
"""More letters of a title never fit."""


class Layer(NamedTuple):
    """Boxes of one colour on a roll.

    Attributes:
        corners: (M, 4, 2) corners of M boxes [s, keys], as `boxes` and `corners` return them.
        face: colour of their faces.
        edge: colour of their edges.
    """

    corners: NDArray[np.float64]
    face: str
    edge: str


@dataclass(frozen=True)
class Lines:
    """How the roll of a performance is laid out in lines of music.

    Attributes:
        rows: number of lines.
        row_seconds: length of the music on each line [s].
        low: lowest key to show.
        high: key after the highest one to show.
        broken: times at which the physics became unstable [s].
    """

    rows: int
    row_seconds: int
    low: int
    high: int
    broken: tuple[float, ...]

    @classmethod
    def of(cls, performance: Performance) -> Lines:
        """Lay out lines that show all keys of the score and of the performance."""
        # A score of 30 s has 601 frames; the silent last one needs no line of its own.
        seconds = performance.song_seconds - 0.1
        rows = min(_MOST_ROWS, max(1, math.ceil(seconds / _ROW_SECONDS)))
        broken = tuple(float(frame) / FRAME_RATE for frame in performance.blow_ups)
        return cls(rows, math.ceil(max(seconds / rows, 1.0)), *_key_range(performance), broken)

    @property
    def height(self) -> float:
        """Height of all lines together [inches]."""
        return self.rows * self._row_height + _FOOT

    @property
    def _row_height(self) -> float:
        return 0.6 + 0.052 * (self.high - self.low)

    def draw(self, figure: Figure, layers: Sequence[Layer], theme: Theme) -> None:
        """Draw the lines at the bottom of a figure.

        Args:
            figure: with at least `height` of free space.
            layers: boxes to draw; later layers cover earlier ones.
            theme: the colours.
        """
        height = figure.get_figheight()
        for row in range(self.rows):
            bottom = self.height - (row + 1) * self._row_height + 0.35
            axes = figure.add_axes(
                (
                    LEFT_EDGE, bottom / height,
                    RIGHT_EDGE - LEFT_EDGE, (self._row_height - 0.35) / height,
                ),
                facecolor=theme.paper,
            )  # fmt: skip
            _paper(axes, self.low, self.high, theme)
            begin, end = row * self.row_seconds, (row + 1) * self.row_seconds
            for layer in layers:
                here = (layer.corners[:, 0, 0] < end) & (layer.corners[:, 2, 0] > begin)
                rectangles = PolyCollection(
                    list(layer.corners[here]),
                    facecolors=layer.face,
                    edgecolors=layer.edge,
                    linewidths=0.7,
                )
                axes.add_collection(rectangles)
                rectangles.set_zorder(3)  # above the line of each C
            for second in self.broken:
                axes.axvline(second, color=theme.wrong, linewidth=0.8, linestyle=":")
            axes.set_xlim(begin, end)
            axes.set_ylim(self.low - 3.2, self.high + 1)
        figure.axes[-1].set_xlabel("seconds", color=theme.faint_text, fontsize=9)


def boxes(
    key: NDArray[np.number], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(M, 4, 2) Corners of boxes [s, keys].

    Args:
        key: (M,) the height of each box.
        start: (M,) when it begins [s].
        end: (M,) when it ends [s].
    """
    low, high = key + 0.08, key + 0.92
    return np.stack([start, low, start, high, end, high, end, low], axis=1).reshape(-1, 4, 2)


def corners(runs: NDArray[np.int64]) -> NDArray[np.float64]:
    """(M, 4, 2) Corners of boxes [s, keys].

    Args:
        runs: (M, 3) first frame, frame after the last one, and key of each box.
    """
    return boxes(runs[:, 2], runs[:, 0] / FRAME_RATE, runs[:, 1] / FRAME_RATE)


def runs(cells: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(M, 3) First frame, frame after the last one, and column of each run of true cells.

    Args:
        cells: (T, K) bool.
    """
    padded = np.pad(cells, ((1, 1), (0, 0))).astype(np.int8).T
    column, start = np.nonzero(np.diff(padded) == 1)
    _, end = np.nonzero(np.diff(padded) == -1)
    return np.stack([start, end, column], axis=1)


def sheet(height: float, title: str, remark: str, theme: Theme) -> Figure:
    """Make an empty picture with a title at the top left and a remark at the top right.

    Args:
        height: height of the picture [inches].
        title: title, which is shortened where it would meet the remark.
        remark: one line.
        theme: the colours.
    """
    figure = Figure(figsize=(WIDTH, height), dpi=110, facecolor=theme.paper)
    heading, small = FontProperties(size=15, weight="bold"), FontProperties(size=10.5)
    room = (RIGHT_EDGE - LEFT_EDGE) * WIDTH - _BETWEEN - _width(remark, small)
    text, letters = title[:_MOST_LETTERS], min(len(title), _MOST_LETTERS)
    while letters and _width(text, heading) > room:
        letters -= 1
        text = f"{title[:letters]}…"
    figure.text(
        LEFT_EDGE, 1 - 0.34 / height, text,
        color=theme.text, fontproperties=heading, va="center",
        # A dollar sign in a title begins no formula.
        parse_math=False, usetex=False,
    )  # fmt: skip
    figure.text(
        RIGHT_EDGE, 1 - 0.34 / height, remark,
        color=theme.faint_text, fontproperties=small, va="center", ha="right",
    )  # fmt: skip
    return figure


def _width(text: str, font: FontProperties) -> float:
    """Width of a line of text [inches]."""
    with _letters_may_lack():
        points: float = text_to_path.get_text_width_height_descent(text, font, ismath=False)[0]
    return points / _POINTS


def save(figure: Figure, path: str | os.PathLike[str], theme: Theme) -> None:
    """Write a picture into a PNG file.

    Args:
        figure: made by `sheet`.
        path: the file to write.
        theme: the colours.
    """
    with _letters_may_lack():
        figure.savefig(path, format="png", facecolor=theme.paper)


@contextmanager
def _letters_may_lack() -> Iterator[None]:
    """A letter of a title that the font lacks is a box in the picture, and no warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


def legend(figure: Figure, entries: Sequence[Artist], theme: Theme) -> None:
    """Add a legend in one line below the title."""
    figure.legend(
        handles=list(entries), loc="center left",
        bbox_to_anchor=(0.047, 1 - 0.7 / figure.get_figheight()),
        ncols=len(entries), frameon=False, labelcolor=theme.text, fontsize=9.5,
        handlelength=1.3, handleheight=0.8, columnspacing=1.6, handletextpad=0.5,
    )  # fmt: skip


def _key_range(performance: Performance) -> tuple[int, int]:
    """Lowest key to show, and the key after the highest one."""
    down = np.flatnonzero(performance.pressed.any(axis=0))
    used = np.concatenate([down, performance.event_key, performance.score.key])
    low, high = (int(used.min()), int(used.max()) + 1) if len(used) else (40, 40)
    middle = (low + high) / 2
    low = max(0, min(low - 2, int(middle - _FEWEST_KEYS / 2)))
    high = min(KEYS, max(high + 2, low + _FEWEST_KEYS))
    return low, high


def _paper(axes: Axes, low: int, high: int, theme: Theme) -> None:
    """Draw stripes for black keys, and a line and a label for every C."""
    for key in range(low, high):
        if BLACK[key]:
            axes.axhspan(key, key + 1, color=theme.black_keys, linewidth=0)
    octaves = [key for key in range(low, high) if (key + LOWEST_PITCH) % KEYS_PER_OCTAVE == 0]
    for key in octaves:
        axes.axhline(key, color=theme.lines, linewidth=0.8)
    axes.set_yticks([key + 0.5 for key in octaves], [key_name(key) for key in octaves])
    axes.tick_params(colors=theme.faint_text, labelsize=8.5, length=0)
    axes.xaxis.grid(visible=True, color=theme.lines, linewidth=0.6)
    axes.set_axisbelow(True)
    for spine in axes.spines.values():
        spine.set_visible(False)
