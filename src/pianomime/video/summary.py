"""Page that shows how well hands, keys and notes were seen in a video."""

from __future__ import annotations

import io
from html import escape
from pathlib import Path
from string import Template

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from pianomime import __version__
from pianomime.files import atomic
from pianomime.keyboard import FRAME_RATE
from pianomime.palette import DARK, LIGHT, Theme
from pianomime.plan import LEFT, RIGHT
from pianomime.video.drawing import Drawing
from pianomime.video.retarget import Retargeted
from pianomime.web_page import data_url, web_page

_PICTURES = 3
_MOST_POINTS = 20_000
"""Most points of a plotted line; the picture has some thousand columns."""

_STYLE = """\
img + img { margin-top: 1rem; }
td:nth-child(2) { text-align: left; }
li { margin: .2rem 0; }
"""
_BODY = Template("""\
<h1>$title</h1>
<p class="under">How well hands, keys and notes were seen</p>
<section><h2>Remarks</h2>$remarks</section>
<section><h2>Where tracking was poor</h2>
<picture>
<source media="(prefers-color-scheme: dark)" srcset="$dark_timeline">
<img alt="Position of both hands and misfit of every note over time" src="$timeline">
</picture>
<p>Dots on the lines: the hand was not seen, and its position is interpolated. Below: the distance
of each note's finger from its key at the onset; above the line it is too far.</p></section>
<section><h2>Frames of the video</h2>$pictures</section>
<section><h2>Quality</h2><table>$quality</table></section>
<footer>Made by PianoMime $version.</footer>
""")


def write_summary(made: Retargeted, path: Path) -> None:
    """Write the page.

    Args:
        made: the retargeted video.
        path: self-contained HTML file; it appears only when complete.
    """
    remarks = "".join(f"<li>{escape(remark)}</li>" for remark in made.remarks)
    title = f"Retargeting {made.demonstration.source}"
    body = _BODY.substitute(
        title=escape(title),
        remarks=f"<ul>{remarks}</ul>" if remarks else "<p>None.</p>",
        timeline=data_url("image/png", _timeline(made, LIGHT)),
        dark_timeline=data_url("image/png", _timeline(made, DARK)),
        version=escape(__version__),
        pictures="".join(
            f'<img alt="keys and hands" src="{data_url("image/png", _png(picture))}">'
            for picture in _pictures(made)
        ),
        quality="".join(
            f"<tr><td>{escape(name.replace('_', ' '))}</td><td>{escape(str(value))}</td></tr>"
            for name, value in made.demonstration.quality.items()
            if name != "remarks"
        ),
    )
    with atomic(path) as temporary:
        temporary.write_text(web_page(f"{title} - PianoMime", body, _STYLE), encoding="utf-8")


def _timeline(made: Retargeted, theme: Theme) -> bytes:
    """PNG of both hands and of the misfit of every note over time."""
    tracks, score, fingers = made.tracks, made.demonstration.score, made.fingers
    figure = Figure(figsize=(12, 4.5), layout="constrained", facecolor=theme.paper)
    hands, notes = figure.subplots(2, 1, sharex=True)
    seconds = np.arange(len(tracks)) / FRAME_RATE
    some = slice(None, None, max(1, len(tracks) // _MOST_POINTS))
    for hand, name in ((LEFT, "left hand"), (RIGHT, "right hand")):
        colour = theme.hands[hand]
        middle = tracks.points[:, hand, 1:, 1].mean(axis=1)
        hands.plot(seconds[some], middle[some], color=colour, label=name)
        lost = ~tracks.found[:, hand]
        label = None if hand == LEFT else "not seen"
        hands.scatter(seconds[lost], middle[lost], color=theme.wrong, s=8, zorder=3, label=label)
        mine = fingers.hand == hand
        notes.scatter(score.onset[mine], np.sqrt(fingers.misfit[mine]), color=colour, s=10)
    hands.set_ylabel("hand along keyboard [m]")
    hands.legend(
        loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False, labelcolor=theme.text
    )
    notes.axhline(3.0, color=theme.wrong, linewidth=0.8)
    notes.set_ylabel("finger off key [1/3 key]")
    notes.set_xlabel("time [s]")
    for axes in (hands, notes):
        axes.set_facecolor(theme.paper)
        axes.grid(color=theme.lines, linewidth=0.6)
        axes.tick_params(colors=theme.faint_text, length=0)
        axes.xaxis.label.set_color(theme.faint_text)
        axes.yaxis.label.set_color(theme.faint_text)
        for spine in axes.spines.values():
            spine.set_visible(False)
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=110)
    return picture.getvalue()


def _pictures(made: Retargeted) -> list[NDArray[np.uint8]]:
    """From each third of the video the frame with the most pressed keys, drawn over."""
    finger_key = made.demonstration.plan.finger_key
    count = min(len(finger_key), len(made.tracks))
    busy = (finger_key[:count] >= 0).sum(axis=(1, 2))
    drawing = Drawing(made.track)
    drawn = []
    for part in np.array_split(np.arange(count), _PICTURES):
        if not len(part):
            continue
        number = int(part[busy[part].argmax()])
        frame = next(made.film.frames(FRAME_RATE, number), None)
        if frame is not None:
            points, found = made.tracks.points[number], made.tracks.found[number]
            drawn.append(drawing.draw(number, frame.picture, points, found, finger_key[number]))
    return drawn


def _png(picture: NDArray[np.uint8]) -> bytes:
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "png")
    return file.getvalue()
