"""Pictures of what is heard: wanted and played notes and touch on one axis, before and after.

Three pieces of the reference data (PIANOMIME_SHARED names its folder) are played by two players. A
few seconds from the middle are drawn, when the hands have long begun.

    python benchmarks/listening.py                      # writes docs/images/listening-*.png
    python benchmarks/listening.py --before zero-shot:0 --after zero-shot:1 --folder out
"""

from __future__ import annotations

import argparse
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray
from PIL import Image

from common import ROOT, shared
from music import LEAD_IN, Playing, playing_of
from pianomime import Performance, Score, excerpt, load_player
from pianomime.files import atomic
from pianomime.keyboard import BLACK, KEYS, KEYS_PER_OCTAVE, LOWEST_PITCH, key_name
from pianomime.music import match_notes
from pianomime.music.key_time import strikes
from pianomime.music.protocol import CONSTANTS
from pianomime.palette import LIGHT

PIECES = {
    "modern": ("Modern clip 115", "modern/test12/clip115.mid"),
    "etude": ("Debussy, Golliwogg's Cakewalk", "etude12/GolliwoggsCakewalk.mid"),
    "touch": (
        "Beethoven, Rondo Op. 51",
        "giantmidi/Beethoven_Ludwig_van_2_Rondos_Op.51_fL4VenZ4PFw.mid",
    ),
}
"""Title and file of each piece, by what the picture is called."""
WINDOW = (6.0, 14.0)
"""[s] What is drawn, from the first note; the players play all up to its end."""

RIGHT, NEAR, FAR, PHANTOM = range(4)
"""What a strike is: a wanted note within 25, 50 or 150 ms, or a note that nobody wanted."""
NEVER = -1
"""Of a wanted note: it is not struck."""
COLOURS = (LIGHT.hands[0], LIGHT.hands[1], LIGHT.hands[2], LIGHT.wrong)
"""Of strikes. All that was not in time is not blue."""

SIZE = 9.0, 10.7
"""[inches] Of a picture, at 100 pixels an inch in the docs."""
DPI = 170
_LEFT, _WIDTH = 0.075, 0.91
_TOP, _HEAD, _ROLL, _TIMING, _TOUCH = 0.8, 0.44, 2.5, 0.85, 0.85
"""[inches] Heights of title and legend, of the line over a roll, of a roll, and of the strips below
it."""
_BETWEEN = 0.06
"""[inches] From a roll to a strip, and from one strip to the next."""
_LATEST = 110.0
"""[ms] What the strip of onset errors shows; what is further off is drawn at its edge."""
_FEWEST_KEYS = 30
_MARGIN = 0.1
"""[s] At the sides of the window."""
_SHADES = 128
"""Colours of the picture as it is kept."""


@dataclass(frozen=True, eq=False)
class Heard:
    """What a performance sounds like in the window.

    Attributes:
        name: of the player.
        wanted: W wanted notes.
        played: E strikes.
        kind: (E,) what each strike is: `RIGHT`, `NEAR`, `FAR` or `PHANTOM`.
        note: (E,) wanted note of each strike, `NEVER` for phantoms.
        struck: (W,) bool, whether a wanted note has a strike of its own.
    """

    name: str
    wanted: Score
    played: Score
    kind: NDArray[np.int64]
    note: NDArray[np.int64]
    struck: NDArray[np.bool_]

    @classmethod
    def of(cls, performance: Performance, name: str) -> Heard:
        """Match what was played with what was wanted, as the music protocol does."""
        wanted, played = strikes(performance.score), strikes(performance.played())
        matched = match_notes(wanted, played)
        note = np.full(len(played), NEVER)
        note[matched.played] = matched.wanted
        kind = np.full(len(played), PHANTOM)
        near, right = CONSTANTS.onset_tolerances[:2]
        error = np.abs(matched.late)
        kind[matched.played] = np.select([error <= right, error <= near], [RIGHT, NEAR], FAR)
        struck = np.zeros(len(wanted), bool)
        struck[matched.wanted] = True
        return cls(name, wanted, played, kind, note, struck)

    def notes(self, begin: float, end: float) -> NDArray[np.int64]:
        """Wanted notes that begin in a part of the music [s]."""
        return np.flatnonzero((self.wanted.onset >= begin) & (self.wanted.onset < end))

    def strikes(self, begin: float, end: float) -> NDArray[np.int64]:
        """Strikes of wanted notes that begin in a part of the music, and phantoms there [s]."""
        at = np.where(self.note == NEVER, self.played.onset, self.wanted.onset[self.note])
        return np.flatnonzero((at >= begin) & (at < end))

    def summary(self, begin: float, end: float) -> str:
        """Counts of notes in a part of the music [s], in words."""
        notes, here = self.notes(begin, end), self.strikes(begin, end)
        kinds = np.bincount(self.kind[here], minlength=4).tolist()
        own = here[self.kind[here] <= NEAR]
        steps = np.abs(self.played.velocity[own] - self.wanted.velocity[self.note[own]])
        soft = int((steps <= CONSTANTS.velocity_steps).sum())
        return (
            f"of {len(notes)} notes, {kinds[RIGHT]} within 25 ms, {kinds[RIGHT] + kinds[NEAR]} "
            f"within 50 ms ({soft} with the right touch); phantoms: {kinds[PHANTOM]}"
        )


def draw(title: str, pair: tuple[Heard, Heard], window: tuple[float, float]) -> Figure:
    """One above the other: notes and touch of both performances.

    Args:
        title: of the piece.
        pair: before and after, of one score.
        window: what is drawn [s].
    """
    figure = Figure(figsize=SIZE, dpi=DPI, facecolor=LIGHT.paper)
    height = SIZE[1]
    _text(figure, _LEFT, 0.27, title, size=14, weight="bold")
    figure.legend(
        handles=_entries(),
        loc="center left",
        bbox_to_anchor=(_LEFT - 0.01, 1 - 0.62 / height),
        ncols=len(_entries()),
        frameon=False,
        labelcolor=LIGHT.text,
        fontsize=9.5,
        handlelength=1.2,
        handleheight=0.8,
        columnspacing=1.5,
        handletextpad=0.5,
    )
    low, high = _key_range(pair, window)
    top = _TOP
    for name, heard in zip(("Before", "After"), pair, strict=True):
        _text(figure, _LEFT, top + _HEAD / 2, f"{name}: {heard.name}", size=10.5, weight="bold")
        words = heard.summary(*window)
        _text(figure, _LEFT + _WIDTH, top + _HEAD / 2, words, size=9, faint=True, ha="right")
        top += _HEAD
        roll = _axes(figure, top, _ROLL, window)
        _draw_roll(roll, heard, low, high, window)
        top += _ROLL + _BETWEEN
        _draw_timing(_axes(figure, top, _TIMING, window), heard, window)
        top += _TIMING + _BETWEEN
        touch = _axes(figure, top, _TOUCH, window)
        _draw_touch(touch, heard, window)
        top += _TOUCH + _BETWEEN
        if heard is pair[-1]:
            touch.set_xlabel("seconds", color=LIGHT.faint_text, fontsize=9.5, labelpad=2)
            touch.tick_params(labelbottom=True)
    return figure


def _draw_roll(axes: Axes, heard: Heard, low: int, high: int, window: tuple[float, float]) -> None:
    """Wanted notes as frames, what was played as bars in them, with a tick where it begins."""
    for key in range(low, high):
        if BLACK[key]:
            axes.axhspan(key, key + 1, color=LIGHT.black_keys, linewidth=0)
    octaves = [key for key in range(low, high) if (key + LOWEST_PITCH) % KEYS_PER_OCTAVE == 0]
    axes.hlines(octaves, *axes.get_xlim(), color=LIGHT.lines, linewidth=0.8)
    axes.set_yticks([key + 0.5 for key in octaves], [key_name(key) for key in octaves])
    axes.set_ylim(low, high)
    wanted, played = heard.wanted, heard.played
    shown = np.flatnonzero((wanted.onset < window[1]) & (wanted.offset > window[0]))
    frames = _boxes(wanted, shown, 0.06)
    axes.add_collection(
        PolyCollection(
            frames, facecolors=LIGHT.paper, edgecolors=LIGHT.hands[2], linewidths=0.8, zorder=3
        )
    )
    for kind, colour in enumerate(COLOURS):
        of = np.flatnonzero(
            (heard.kind == kind) & (played.onset < window[1]) & (played.offset > window[0])
        )
        over = 6 if kind == PHANTOM else 4
        bars = PolyCollection(_boxes(played, of, 0.24), facecolors=colour, alpha=0.45, linewidths=0)
        axes.add_collection(bars)
        bars.set_zorder(over)
        # A phantom can be shorter than a dot.
        ticks = [[(played.onset[i], played.key[i] - 0.02), (played.onset[i], played.key[i] + 1.02)]
                 for i in of]  # fmt: skip
        axes.add_collection(LineCollection(ticks, colors=colour, linewidths=2.4, zorder=over + 1))
    missed = shown[~heard.struck[shown]]
    axes.scatter(
        wanted.onset[missed],
        wanted.key[missed] + 0.5,
        marker="x",
        s=34,
        linewidths=1.8,
        color=LIGHT.wrong,
        zorder=8,
    )


def _draw_timing(axes: Axes, heard: Heard, window: tuple[float, float]) -> None:
    """How late each wanted note is struck."""
    here = heard.strikes(*window)
    own = here[heard.note[here] != NEVER]
    at = heard.wanted.onset[heard.note[own]]
    late = np.clip(1000 * (heard.played.onset[own] - at), -_LATEST, _LATEST)
    right, near = 1000 * CONSTANTS.onset_tolerances[1], 1000 * CONSTANTS.onset_tolerances[0]
    axes.axhspan(-right, right, color=LIGHT.wanted[0], alpha=0.45, linewidth=0)
    axes.axhline(0, color=LIGHT.hands[2], linewidth=0.8)
    lines = [[(x, 0), (x, y)] for x, y in zip(at, late, strict=True)]
    axes.add_collection(LineCollection(lines, colors=LIGHT.hands[2], alpha=0.5, linewidths=0.8))
    colours = np.array(COLOURS)[heard.kind[own]]
    axes.scatter(at, late, s=15, color=colours, linewidths=0, zorder=4, clip_on=False)
    axes.set_ylim(-_LATEST, _LATEST)
    axes.set_yticks([-near, 0, near], [f"{-near:+.0f}", "0", f"{near:+.0f}"])
    _label(axes, "late by (ms)")


def _draw_touch(axes: Axes, heard: Heard, window: tuple[float, float]) -> None:
    """Wanted velocities as rings, played ones as dots, and a line from one to the other."""
    here = heard.strikes(*window)
    own = here[heard.note[here] != NEVER]
    note = heard.note[own]
    at = heard.wanted.onset[note]
    asked, given = heard.wanted.velocity[note], heard.played.velocity[own]
    lines = [[(x, low), (x, high)] for x, low, high in zip(at, asked, given, strict=True)]
    axes.add_collection(LineCollection(lines, colors=LIGHT.lines, linewidths=1.2, zorder=2))
    axes.scatter(
        at, asked, s=26, facecolors="none", edgecolors=LIGHT.hands[2], linewidths=1.0, zorder=5
    )
    colours = np.array(COLOURS)[heard.kind[here]]
    when = np.where(heard.note[here] == NEVER, heard.played.onset[here], np.nan)
    when[heard.note[here] != NEVER] = at
    axes.scatter(when, heard.played.velocity[here], s=12, color=colours, linewidths=0, zorder=4)
    axes.set_ylim(-4, 131)
    axes.set_yticks([32, 64, 96])
    axes.yaxis.grid(visible=True, color=LIGHT.lines, linewidth=0.6)
    _label(axes, "touch (MIDI velocity; rings: wanted)")


def _label(axes: Axes, words: str) -> None:
    """What a strip shows, in its upper left corner."""
    text = axes.text(
        0.006, 0.93, words, transform=axes.transAxes,
        color=LIGHT.faint_text, fontsize=8.5, va="top", zorder=9,
    )  # fmt: skip
    text.set_bbox({"facecolor": LIGHT.paper, "linewidth": 0, "pad": 1.0, "alpha": 0.8})


def _axes(figure: Figure, top: float, height: float, window: tuple[float, float]) -> Axes:
    """Axes of the width of the picture; `top` is from the upper edge [inches]."""
    whole = figure.get_figheight()
    axes = figure.add_axes((_LEFT, 1 - (top + height) / whole, _WIDTH, height / whole))
    axes.set_xlim(window[0] - _MARGIN, window[1] + _MARGIN)
    axes.set_xticks(np.arange(np.ceil(window[0]), window[1] + 0.5))
    axes.xaxis.grid(visible=True, color=LIGHT.lines, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(colors=LIGHT.faint_text, labelsize=9, length=0, labelbottom=False)
    for spine in axes.spines.values():
        spine.set_color(LIGHT.lines)
    return axes


def _boxes(score: Score, notes: NDArray[np.int64], inset: float) -> list[NDArray[np.float64]]:
    """Corners of the boxes of notes [s, keys]."""
    low, high = score.key[notes] + inset, score.key[notes] + 1 - inset
    begin, end = score.onset[notes], score.offset[notes]
    return list(np.stack([begin, low, begin, high, end, high, end, low], 1).reshape(-1, 4, 2))


def _key_range(pair: tuple[Heard, Heard], window: tuple[float, float]) -> tuple[int, int]:
    """Lowest key to show, and the key after the highest."""
    keys = np.concatenate(
        [each.wanted.key[each.notes(*window)] for each in pair]
        + [each.played.key[each.strikes(*window)] for each in pair]
    )
    low, high = int(keys.min()) - 2, int(keys.max()) + 3
    missing = max(_FEWEST_KEYS - (high - low), 0)
    return max(low - missing // 2, 0), min(high + missing - missing // 2, KEYS)


def _entries() -> list[Artist]:
    """Entries of the legend."""
    labels = ("struck within 25 ms", "within 50 ms", "within 150 ms", "phantom")
    return [
        Patch(facecolor=LIGHT.paper, edgecolor=LIGHT.hands[2], linewidth=0.9, label="wanted note"),
        *(Patch(color=each, label=label) for each, label in zip(COLOURS, labels, strict=True)),
        Line2D(
            [], [], color=LIGHT.wrong, marker="x", linestyle="", markeredgewidth=1.8,
            markersize=6, label="never struck",
        ),
    ]  # fmt: skip


def _text(
    figure: Figure,
    x: float,
    top: float,
    words: str,
    *,
    size: float,
    faint: bool = False,
    **style: str,
) -> None:
    """A line of text, its middle so many inches below the upper edge."""
    colour = LIGHT.faint_text if faint else LIGHT.text
    y = 1 - top / figure.get_figheight()
    figure.text(x, y, words, color=colour, fontsize=size, va="center", parse_math=False, **style)


def heard(playing: Playing, song: Path, window: tuple[float, float]) -> Heard:
    """Play a song up to the end of the window."""
    score = excerpt(Score.from_midi(song), seconds=window[1], lead_in=playing.lead_in)
    player = load_player(playing.player, playing.effort, **playing.settings)
    return Heard.of(player.play(score), f"{playing.player}, effort {playing.effort}")


def save(figure: Figure, path: Path) -> None:
    """Write a picture, in few colours: it is to be small."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        large = Path(folder, "large.png")
        figure.savefig(large, facecolor=LIGHT.paper)
        with Image.open(large) as opened:
            small = opened.convert("RGB").quantize(_SHADES, dither=Image.Dither.NONE)
    with atomic(path) as temporary:
        small.save(temporary, format="png", optimize=True)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


def options() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for when, player in (("before", "zero-shot-20hz:1"), ("after", "zero-shot:1")):
        made.add_argument(
            f"--{when}",
            type=playing_of,
            default=player,
            metavar="PLAYER:EFFORT",
            help=f"who plays {when} (%(default)s)",
        )
    made.add_argument(
        "--pieces", nargs="+", choices=PIECES, default=[*PIECES], help="which are drawn (all)"
    )
    made.add_argument(
        "--folder",
        type=Path,
        default=ROOT / "docs" / "images",
        help="where the pictures go (%(default)s)",
    )
    return made


def main() -> None:
    """Play, and draw."""
    asked = options().parse_args()
    # In the time of the score, which begins with the lead-in.
    window = WINDOW[0] + LEAD_IN, WINDOW[1] + LEAD_IN
    for piece in asked.pieces:
        title, file = PIECES[piece]
        song = shared() / "data" / file
        pair = tuple(heard(playing, song, window) for playing in (asked.before, asked.after))
        save(draw(title, pair, window), asked.folder / f"listening-{piece}.png")


if __name__ == "__main__":
    main()
