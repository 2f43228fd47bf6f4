"""Picture of confidence over time, of what lowers it, and of hands and notes in a video."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE
from pianomime.palette import Theme
from pianomime.plan import LEFT, RIGHT
from pianomime.video.confidence import DOUBT
from pianomime.video.retarget import Retargeted

_MOST_POINTS = 20_000
"""Most points of a plotted line; the picture has some thousand columns."""
_A_KEY = 3.0
"""The width of a white key, in the unit of the root of `touch.misfit`."""
_SHORTEST_BAR = 0.004
"""Share of the video that a cause takes at least in the picture, to be seen."""


def draw_timeline(made: Retargeted, theme: Theme) -> bytes:
    """Draw the picture.

    Args:
        made: the retargeted video.
        theme: colours.

    Returns:
        A PNG file.
    """
    figure = Figure(figsize=(12, 8.4), layout="constrained", facecolor=theme.paper)
    confidence, causes, hands, notes = figure.subplots(
        4, 1, sharex=True, height_ratios=[1.4, 1.1, 1.4, 1.1]
    )
    _confidence(confidence, made, theme)
    _causes(causes, made, theme)
    _hands(hands, made, theme)
    _notes(notes, made, theme)
    notes.set_xlabel("time [s]")
    notes.set_xlim(0, len(made.tracks) / FRAME_RATE)
    figure.align_ylabels()
    for axes in (confidence, causes, hands, notes):
        axes.set_facecolor(theme.paper)
        axes.grid(color=theme.lines, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(colors=theme.faint_text, length=0)
        axes.xaxis.label.set_color(theme.faint_text)
        axes.yaxis.label.set_color(theme.faint_text)
        for spine in axes.spines.values():
            spine.set_visible(False)
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=110)
    return picture.getvalue()


def _confidence(axes: Axes, made: Retargeted, theme: Theme) -> None:
    # Where no keyboard is shown, there is a gap.
    frames = np.where(made.confidence.missing, np.nan, made.confidence.frames)
    first = np.arange(0, len(frames), max(1, len(frames) // _MOST_POINTS))
    # The lowest of frames that share a column: no short doubt gets lost.
    lowest = np.fmin.reduceat(frames, first)
    seconds = first / FRAME_RATE
    axes.fill_between(seconds, lowest, color=theme.hands[LEFT], alpha=0.25, linewidth=0)
    axes.plot(seconds, lowest, color=theme.hands[LEFT], linewidth=1.4)
    doubt = lowest < DOUBT
    axes.fill_between(seconds, lowest, 1, where=doubt, color=theme.wrong, alpha=0.15, linewidth=0)
    axes.axhline(DOUBT, color=theme.wrong, linewidth=0.8)
    axes.set_ylim(0, 1.03)
    axes.set_yticks([0, DOUBT, 1])
    axes.set_ylabel("confidence")


def _causes(axes: Axes, made: Retargeted, theme: Theme) -> None:
    tracks, confidence = made.tracks, made.confidence
    shown = ~confidence.missing
    guessed = np.zeros(len(tracks), bool)
    onset = made.demonstration.score.note_frames()[~confidence.supported, 0]
    guessed[np.minimum(onset, len(tracks) - 1)] = True
    rows = [
        ("left hand not seen", ~tracks.found[:, LEFT] & shown, theme.hands[LEFT]),
        ("right hand not seen", ~tracks.found[:, RIGHT] & shown, theme.hands[RIGHT]),
        ("outliers replaced", np.any(tracks.mended, axis=(1, 2)), theme.faint_text),
        ("finger guessed", guessed, theme.wrong),
        ("keyboard hidden, moved", (confidence.keyboard < DOUBT) & shown, theme.wrong),
        ("no keyboard shown", ~shown, theme.faint_text),
    ]
    for row, (_, holds, colour) in enumerate(rows):
        axes.broken_barh(_spans(holds, len(tracks)), (row - 0.35, 0.7), color=colour, linewidth=0)
    axes.set_yticks(range(len(rows)), [name for name, _, _ in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)


def _spans(holds: NDArray[np.bool_], frames: int) -> list[tuple[float, float]]:
    """Beginning and length [s] of the intervals in which something holds, wide enough to see."""
    edges = np.flatnonzero(np.diff(holds.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    least = _SHORTEST_BAR * frames
    return [
        (first / FRAME_RATE, max(end - first, least) / FRAME_RATE) for first, end in edges.tolist()
    ]


def _hands(axes: Axes, made: Retargeted, theme: Theme) -> None:
    tracks = made.tracks
    seconds = np.arange(len(tracks)) / FRAME_RATE
    some = slice(None, None, max(1, len(tracks) // _MOST_POINTS))
    for hand, name in ((LEFT, "left hand"), (RIGHT, "right hand")):
        middle = tracks.points[:, hand, 1:, 1].mean(axis=1)
        axes.plot(seconds[some], middle[some], color=theme.hands[hand], label=name)
        lost = ~tracks.found[:, hand]
        label = None if hand == LEFT else "not seen"
        axes.scatter(seconds[lost], middle[lost], color=theme.wrong, s=8, zorder=3, label=label)
    axes.set_ylabel("hand along\nkeyboard [m]")
    axes.legend(
        loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False, labelcolor=theme.text
    )


def _notes(axes: Axes, made: Retargeted, theme: Theme) -> None:
    score, fingers, supported = made.demonstration.score, made.fingers, made.confidence.supported
    off = np.sqrt(fingers.misfit)
    for hand in (LEFT, RIGHT):
        mine = (fingers.hand == hand) & supported
        axes.scatter(score.onset[mine], off[mine], color=theme.hands[hand], s=10)
    axes.scatter(score.onset[~supported], off[~supported], color=theme.wrong, s=14, marker="x")
    # A whole key, so that a good fit does not look bad.
    axes.set_ylim(0, max(_A_KEY, 1.05 * float(off.max(initial=0.0))))
    axes.set_ylabel("finger off key\n[1/3 key]")
