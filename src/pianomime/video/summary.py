"""Page that shows how far a demonstration made from a video can be trusted, and what to do."""

from __future__ import annotations

import io
from collections.abc import Sequence
from html import escape
from pathlib import Path
from string import Template

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from pianomime import __version__
from pianomime.files import atomic
from pianomime.keyboard import FRAME_RATE, NO_KEY
from pianomime.palette import DARK, LIGHT, rgb
from pianomime.video.drawing import Drawing, key_outline
from pianomime.video.keyboard.plane import Plane
from pianomime.video.moments import Moment, good_moment, worst_moments
from pianomime.video.remarks import Remark
from pianomime.video.repairs import Repair
from pianomime.video.retarget import Retargeted
from pianomime.video.timeline import draw_timeline
from pianomime.web_page import data_url, web_page
from pianomime.world.layout import FINGER_COUNT
from pianomime.world.parameters import key_centres

_SHOWN_X = (-0.13, 0.24)
"""World x of the part of a picture that is shown: what is above the keys, to the wrists [m]."""
_JPEG_QUALITY = 85
_MARK = rgb(DARK.wrong)
"""Colour of the frames about keys that no finger is on; bright, as pictures are mostly dark."""
_ORDER = ("wrong", "check", "note")
"""Weights of remarks, the most important first."""
_LISTED = 5
"""Most remarks of one kind that are listed; hours of video can have hundreds."""

_STYLE = """\
table.many td:nth-child(2), table.facts td:nth-child(2) { text-align: left; }
table.many td:nth-child(n+2) { text-align: right; white-space: nowrap; padding-left: 1rem; }
table.facts td:first-child { white-space: nowrap; }
tr.none td { color: var(--faint); }
ol, ul { margin: 0; padding-left: 1.25rem; }
li { margin: .45rem 0; }
li strong, figcaption strong { font-weight: 600; }
.do { display: block; color: var(--faint); }
.do::before { content: "\\2192\\00a0"; }
figure { margin: 0 0 1.1rem; }
figcaption { margin-top: .35rem; }
.verdict { font-size: 1.2rem; font-weight: 600; border-left: 5px solid var(--right); }
.verdict.good { border-left-color: #1f9d55; }
.verdict.doubtful { border-left-color: var(--wrong); }
.verdict p { margin: 0; }
.verdict small { display: block; margin-top: .35rem; font-weight: 400; font-size: .9rem; }
"""
_BODY = Template("""\
<h1>$title</h1>
<p class="under">How far this demonstration can be trusted, and what to do</p>
<section class="verdict $grade"><p>$verdict</p><small>$measured</small></section>
<section><h2>What to do</h2>$remarks</section>
<section><h2>$worst_title</h2>$worst</section>
$good
<section><h2>Confidence over time</h2>
<picture>
<source media="(prefers-color-scheme: dark)" srcset="$dark_timeline">
<img alt="Confidence, what lowers it, both hands and the misfit of every note over time"
 src="$timeline">
</picture>
<p>Confidence is the product of three parts: how well the hands are seen, whether the keys are where
they should be, and how much better than by chance notes have a finger on their key. Below the line
it is in doubt. Then what lowers it; where the hands are (dots: not seen, and interpolated); and the
distance of each note's finger from its key (crosses: no finger was on the key).</p></section>
<section><h2>What was repaired</h2><table class="many">$repairs</table></section>
<section><h2>Technical facts</h2><table class="facts">$facts</table></section>
<footer>Made by PianoMime $version.</footer>
""")
_FACTS = {
    "keyboard": "keyboard",
    "black_and_white_agree": "black and white keys where they should be (1: all of them; shifted "
    "by keys: 0.65 at most)",
    "notes_from": "notes are from",
    "keys_lit_confidence": "how sure it is that keys light up",
    "offset_seconds": "the notes begin after the video begins [s]",
    "parallax_millimetres": "parallax corrected, median [mm]",
    "align": "--align",
    "seconds": "seconds of video",
    "seconds_with_keyboard": "seconds in which a keyboard is seen",
}
"""What is shown of `Demonstration.quality` at the end, and what it is called."""


def write_summary(made: Retargeted, path: Path) -> None:
    """Write the page.

    Args:
        made: the retargeted video.
        path: self-contained HTML file; it appears only when complete.
    """
    title = f"Retargeting {made.demonstration.source}"
    quality = made.demonstration.quality
    drawn = _Pictures(made)
    worst, good = worst_moments(made), good_moment(made)
    body = _BODY.substitute(
        title=escape(title),
        grade=made.verdict.grade,
        verdict=escape(made.verdict.line),
        measured=escape(_measured(made)),
        remarks=_remarks(made.remarks),
        worst_title="The worst moments" if len(worst) > 1 else "The worst moment",
        worst="".join(map(drawn.figure, worst)),
        good=""
        if good is None
        else f"<section><h2>A good moment, to compare</h2>{drawn.figure(good)}</section>",
        timeline=data_url("image/png", draw_timeline(made, LIGHT)),
        dark_timeline=data_url("image/png", draw_timeline(made, DARK)),
        repairs="".join(map(_repair, made.repairs)),
        facts="".join(
            f"<tr><td>{escape(name)}</td><td>{escape(str(quality[key]))}</td></tr>"
            for key, name in _FACTS.items()
            if quality.get(key) is not None
        ),
        version=escape(__version__),
    )
    with atomic(path) as temporary:
        temporary.write_text(web_page(f"{title} - PianoMime", body, _STYLE), encoding="utf-8")


def _measured(made: Retargeted) -> str:
    """What the verdict rests on, in one line."""
    agreed = made.confidence.agreement
    quality = made.demonstration.quality
    return (
        f"{agreed.share:.0%} of {quality['notes']} notes have a finger on their key when they "
        f"begin; shifted to other keys or times, {agreed.chance:.0%} of them would. "
        f"{quality['seconds_in_doubt']:.1f} s of {quality['seconds_with_keyboard']:.1f} s are in "
        "doubt."
    )


def _remarks(remarks: Sequence[Remark]) -> str:
    """A list of what is wrong and what to do, the most important first, one item an action."""
    if not remarks:
        return "<p>Nothing.</p>"
    by_action: dict[str, list[Remark]] = {}
    for remark in sorted(remarks, key=lambda each: _ORDER.index(each.weight)):
        by_action.setdefault(remark.action, []).append(remark)
    items = []
    for action, same in by_action.items():
        texts = [_text(remark) for remark in same[:_LISTED]]
        if len(same) > _LISTED:
            texts.append(f"{len(same) - _LISTED} more such remarks")
        do = f'<span class="do">{escape(action)}</span>' if action else ""
        items.append(f"<li>{'<br>'.join(texts)}{do}</li>")
    return f"<ul>{''.join(items)}</ul>"


def _text(remark: Remark) -> str:
    return (
        f"<strong>{escape(remark.text)}</strong>"
        if remark.weight != "note"
        else escape(remark.text)
    )


def _repair(repair: Repair) -> str:
    share = "" if repair.total is None else f"of {repair.total}"
    percent = "" if not repair.total else f"{repair.count / repair.total:.1%}"
    none = "" if repair.count else ' class="none"'
    cells = (repair.text, str(repair.count), share, percent)
    return f"<tr{none}>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"


class _Pictures:
    """Frames of the video with keys and hands drawn into them."""

    def __init__(self, made: Retargeted) -> None:
        self._made = made
        self._drawing = Drawing(made.track)

    def figure(self, moment: Moment) -> str:
        """HTML of a moment: picture, time, confidence and reason."""
        made, number = self._made, moment.frame
        frame = next(made.film.frames(FRAME_RATE, number), None)
        if frame is None:
            return ""
        finger_key = made.demonstration.plan.finger_key
        keys = (
            finger_key[number]
            if number < len(finger_key)
            else np.full((2, FINGER_COUNT), NO_KEY, np.int8)
        )
        points, found = made.tracks.points[number], made.tracks.found[number]
        picture = self._drawing.draw(number, frame.picture, points, found, keys)
        plane = made.track.at(number)
        if plane is not None:
            picture = self._mark(picture, plane, number)
            picture = picture[_rows(plane, picture.shape[:2])]
        time = f"{number / FRAME_RATE:.1f} s"
        caption = (
            f"<strong>{time}</strong>, confidence {moment.confidence:.2f}: {escape(moment.reason)}"
        )
        source = data_url("image/jpeg", _jpeg(picture))
        return (
            f'<figure><img alt="keys and hands at {time}" src="{source}">'
            f"<figcaption>{caption}</figcaption></figure>"
        )

    def _mark(self, picture: NDArray[np.uint8], plane: Plane, number: int) -> NDArray[np.uint8]:
        """Frame the keys of notes that no finger is on, of those that sound in a frame."""
        score, supported = self._made.demonstration.score, self._made.confidence.supported
        first, end = score.note_frames().T
        image = Image.fromarray(picture)
        pen = ImageDraw.Draw(image)
        width = max(3, picture.shape[1] // 400)
        for key in score.key[(first <= number) & (number < end) & ~supported]:
            corners = plane.to_pixels(key_outline(int(key)))
            pen.polygon([tuple(corner) for corner in corners.tolist()], outline=_MARK, width=width)
        return np.asarray(image, np.uint8)


def _rows(plane: Plane, size: tuple[int, ...]) -> slice:
    """The rows of a picture in which keys and hands are."""
    ends = key_centres()[[0, -1], 1]
    corners = plane.to_pixels(np.array([[x, y] for x in _SHOWN_X for y in ends]))
    low, high = np.clip(np.sort(corners[:, 1])[[0, -1]], 0, size[0]).astype(int)
    # A plane that is far off may be outside the picture: then all of it is shown.
    return slice(low, high) if high > low + size[0] // 10 else slice(None)


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "jpeg", quality=_JPEG_QUALITY)
    return file.getvalue()
