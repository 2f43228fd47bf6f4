"""Page that shows how well hands, keys and notes were seen in a video."""

from __future__ import annotations

import base64
import io
from html import escape
from pathlib import Path
from string import Template

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from pianomime.files import atomic
from pianomime.keyboard import FRAME_RATE
from pianomime.plan import LEFT, RIGHT
from pianomime.video.drawing import HAND_COLOURS, Drawing
from pianomime.video.retarget import Retargeted

_PICTURES = 3
_MOST_POINTS = 20_000
"""Most points of a plotted line; the picture has some thousand columns."""

_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>$title</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><style>
:root { color-scheme: light dark; font-family: system-ui, sans-serif; }
body { max-width: 72rem; margin: 2rem auto; padding: 0 1rem; line-height: 1.5; }
img { width: 100%; } table { border-collapse: collapse; }
td { padding: .2rem 1rem .2rem 0; vertical-align: top; } li { margin: .2rem 0; }
</style></head><body><h1>$title</h1>
<h2>Remarks</h2>$remarks
<h2>Where tracking was poor</h2>
<p>Red: the hand was not seen, and its position is interpolated. Below: the distance of each note's
finger from its key at the onset.</p>
<img alt="tracking over time" src="$timeline">
<h2>Frames of the video</h2>$pictures
<h2>Quality</h2><table>$quality</table></body></html>
""")


def write_summary(made: Retargeted, path: Path) -> None:
    """Write the page.

    Args:
        made: the retargeted video.
        path: self-contained HTML file; it appears only when complete.
    """
    remarks = "".join(f"<li>{escape(remark)}</li>" for remark in made.remarks)
    page = _PAGE.substitute(
        title=escape(f"Retargeting {made.demonstration.source}"),
        remarks=f"<ul>{remarks}</ul>" if remarks else "<p>None.</p>",
        timeline=_data(_timeline(made)),
        pictures="".join(
            f'<p><img alt="keys and hands" src="{_data(_png(picture))}"></p>'
            for picture in _pictures(made)
        ),
        quality="".join(
            f"<tr><td>{escape(name.replace('_', ' '))}</td><td>{escape(str(value))}</td></tr>"
            for name, value in made.demonstration.quality.items()
            if name != "remarks"
        ),
    )
    with atomic(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _timeline(made: Retargeted) -> bytes:
    """PNG of both hands and of the misfit of every note over time."""
    tracks, score, fingers = made.tracks, made.demonstration.score, made.fingers
    figure = Figure(figsize=(12, 4.5), layout="constrained")
    hands, notes = figure.subplots(2, 1, sharex=True)
    seconds = np.arange(len(tracks)) / FRAME_RATE
    some = slice(None, None, max(1, len(tracks) // _MOST_POINTS))
    for hand, name in ((LEFT, "left"), (RIGHT, "right")):
        colour = np.array(HAND_COLOURS[hand]) / 255
        middle = tracks.points[:, hand, 1:, 1].mean(axis=1)
        hands.plot(seconds[some], middle[some], color=colour, label=name)
        lost = ~tracks.found[:, hand]
        hands.scatter(seconds[lost], middle[lost], color="red", s=8, zorder=3)
        mine = fingers.hand == hand
        notes.scatter(score.onset[mine], np.sqrt(fingers.misfit[mine]), color=colour, s=10)
    hands.set_ylabel("hand along keyboard [m]")
    hands.legend(loc="upper right")
    notes.axhline(3.0, color="red", linewidth=0.8)
    notes.set_ylabel("finger off key [1/3 key]")
    notes.set_xlabel("time [s]")
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=110)
    return picture.getvalue()


def _pictures(made: Retargeted) -> list[NDArray[np.uint8]]:
    """From each third of the video the frame with the most pressed keys, drawn over."""
    finger_key = made.demonstration.plan.finger_key
    count = min(len(finger_key), len(made.tracks))
    busy = (finger_key[:count] >= 0).sum(axis=(1, 2))
    drawing = Drawing(made.plane)
    drawn = []
    for part in np.array_split(np.arange(count), _PICTURES):
        if not len(part):
            continue
        number = int(part[busy[part].argmax()])
        frame = next(made.film.frames(FRAME_RATE, number), None)
        if frame is not None:
            points, found = made.tracks.points[number], made.tracks.found[number]
            drawn.append(drawing.draw(frame.picture, points, found, finger_key[number]))
    return drawn


def _png(picture: NDArray[np.uint8]) -> bytes:
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "png")
    return file.getvalue()


def _data(png: bytes) -> str:
    return f"data:image/png;base64,{base64.b64encode(png).decode()}"
