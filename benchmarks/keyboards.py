"""Whether the keyboard is found and its keys named right: real frames, and variants of one film.

    python benchmarks/keyboards.py                  frames and variants
    python benchmarks/keyboards.py --only frame10 turned

It needs the reference data (PIANOMIME_SHARED): frames with the places of white keys, marked by eye,
and a film whose plane is known. `right`: every key has its name and is in its place (half a white
key on frames; 6 mm on variants, in every frame of those whose camera moves), and no doubt is said.
`wrong`: it is not, without a word. `doubt`: refused, or several namings are said to be possible.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

import common
from pianomime.keyboard import BLACK, FRAME_RATE, key_name
from pianomime.progress import no_progress
from pianomime.video.film.background import median_of
from pianomime.video.film.film import Film
from pianomime.video.keyboard.geometry import LEFT_EDGE, WHITE_WIDTH
from pianomime.video.keyboard.keyboard import Keyboard, find_keyboards
from pianomime.video.keyboard.plane import Plane
from pianomime.video.keyboard.views import find_views
from pianomime.world.parameters import key_centres

_COUNT = 25
"""Pictures of the film of which each variant is made."""
_NEAR = 0.006
"""[m] Greatest error of a key's place in a variant."""
_SECONDS = 12.0
"""[s] Length of the variants whose camera moves."""
_UNSEEN = 0.02
"""Most frames in which a keyboard that is there may be missed, as a share."""
_WHITES_BELOW = np.cumsum(~BLACK) - 1
Pictures = list[NDArray[np.uint8]]


def main() -> None:
    options = common.parser("keyboards", __doc__)
    options.add_argument("--only", nargs="+", default=[""], help="parts of names")
    given = options.parse_args()
    shared = common.shared()
    facts = common.machine()
    rows = []
    for row in _rows(shared, given.only):
        rows.append(row)
        print("  ".join(str(value) for value in row.values()), flush=True)
    print()
    for kind in sorted({row["kind"] for row in rows}):
        of_kind = [row["verdict"] for row in rows if row["kind"] == kind]
        counts = {word: of_kind.count(word) for word in ("right", "wrong", "doubt")}
        print(f"{kind}: {counts}")
    common.report(given.output, facts, {"keyboards": rows})


def _rows(shared: Path, only: list[str]) -> Iterator[dict[str, Any]]:
    video = shared / "data" / "video"
    for truth in json.loads((video / "truth.json").read_text("utf-8")):
        name = Path(truth["file"]).stem
        if any(part in name for part in only):
            picture = np.asarray(Image.open(video / truth["file"]).convert("RGB"))
            found = find_keyboards(median_of([picture]))
            kind = "frames" if truth["keyboard"] else "frames without a keyboard"
            yield {"kind": kind, "name": name, **_judge_frame(truth, found)}
    stan = shared / "data" / "stan"
    wanted = [name for name in (*VARIANTS, *MOVING) if any(part in name for part in only)]
    if not wanted:
        return
    swap = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    plane = Plane(swap @ np.load(stan / "reference.npz")["homography"])
    film = Film(stan / "Stan_1.mp4")
    pictures = film.sample(_COUNT)
    for name in wanted:
        if name in MOVING:
            yield {"kind": "variants", "name": name, **_moving(film, plane, MOVING[name])}
            continue
        if name.endswith("frames/s"):
            seconds = film.seconds / _COUNT
            rate = float(name.split()[0])
            step = max(1, int(seconds * rate))
            every = islice(film.frames(rate), None, None, step)
            shown, moved = [frame.picture for frame in every], np.eye(3)
        else:
            shown, moved = VARIANTS[name](pictures)
        found = find_keyboards(median_of(shown))
        truth_plane = Plane(plane.matrix @ np.linalg.inv(moved))
        yield {"kind": "variants", "name": name, **_judge(truth_plane, shown[0].shape, found)}


def _said(found: list[Keyboard]) -> str:
    return f"{found[0].describe()}; {len(found)} namings" if found else "no keyboard"


def _judge_frame(truth: dict[str, Any], found: list[Keyboard]) -> dict[str, Any]:
    """The verdict on a frame, against the keys that were marked in it."""
    if not truth["keyboard"] or not found:
        good = len(found) != 1
        return {"verdict": "doubt" if good else "wrong", "said": _said(found)}
    keys = np.array([int(key) for key in truth["keys_px"]])
    world = found[0].plane.to_world(list(truth["keys_px"].values()))
    off = (world[:, 1] - LEFT_EDGE) / WHITE_WIDTH - 0.5 - _WHITES_BELOW[keys]
    octave = 7 * round(float(np.median(off)) / 7)
    if truth["octave_known"]:
        octave = 0
    right = bool(np.abs(off - octave).max() < 0.6) and found[0].mirrored == truth["mirrored"]
    verdict = ("right" if right else "wrong") if len(found) == 1 else "doubt"
    return {"verdict": verdict, "said": _said(found)}


def _moving(film: Film, plane: Plane, move: Callable[[float], Any]) -> dict[str, Any]:
    """The verdict on a variant whose camera moves: written as a film, and judged in all frames."""
    frames = round(_SECONDS * FRAME_RATE)
    moved = [move(number / frames) for number in range(frames)]
    with TemporaryDirectory() as folder:
        path = Path(folder, "film.mp4")
        with av.open(str(path), "w") as container:
            stream = container.add_stream("libx264", rate=round(FRAME_RATE), options={"crf": "23"})
            stream.width, stream.height, stream.pix_fmt = 1280, 720, "yuv420p"
            for way, frame in zip(moved, film.frames(FRAME_RATE), strict=False):
                card = np.full_like(frame.picture, 240)
                shown = card if way is None else _warp([frame.picture], way)[0][0]
                container.mux(stream.encode(av.VideoFrame.from_ndarray(shown)))
            container.mux(stream.encode())
        views = find_views(Film(path), frames, None, None, no_progress)
    if len(views) != 1:
        return {"verdict": "doubt", "said": f"{len(views)} namings"}
    view = views[0]
    told = bool(view.guessed) or len(view.namings) > 1
    keys = key_centres()[:, :2]
    worst, unseen, phantoms = 0.0, 0, 0
    for number, way in enumerate(moved):
        found = view.track.at(number)
        if way is None or found is None:
            phantoms += way is None and found is not None
            unseen += way is not None and found is None
            continue
        pixels = Plane(plane.matrix @ np.linalg.inv(way)).to_pixels(keys)
        visible = ((pixels > 0) & (pixels < (1280, 720))).all(axis=1)
        off = np.linalg.norm(found.to_world(pixels[visible]) - keys[visible], axis=1)
        worst = max(worst, float(off.max()))
    right = worst < _NEAR and not phantoms and unseen < _UNSEEN * frames
    said = (
        f"{view.description}; at most {1000 * worst:.1f} mm off in {frames} frames; keyboard not "
        f"found in {unseen}, found on a card in {phantoms}"
    )
    return {"verdict": "doubt" if told else ("right" if right else "wrong"), "said": said}


def _judge(truth: Plane, shape: tuple[int, ...], found: list[Keyboard]) -> dict[str, Any]:
    """The verdict on a variant, against its known plane."""
    if len(found) != 1:
        return {"verdict": "doubt", "said": _said(found)}
    keys = key_centres()[:, :2]
    pixels = truth.to_pixels(keys)
    visible = ((pixels > 0) & (pixels < shape[1::-1])).all(axis=1)
    off = np.linalg.norm(found[0].plane.to_world(pixels) - keys, axis=1)[visible]
    verdict = "right" if off.max() < _NEAR else "wrong"
    ends = [key_name(int(key)) for key in np.flatnonzero(visible)[[0, -1]]]
    said = f"{_said(found)}; truth {ends[0]} to {ends[1]}; off {1000 * np.median(off):.1f} mm"
    return {"verdict": verdict, "said": f"{said}, at most {1000 * off.max():.1f}"}


def _warp(
    pictures: Pictures, moved: NDArray[np.float64], size: tuple[int, int] | None = None
) -> tuple[Pictures, NDArray[np.float64]]:
    """Pictures moved by a homography of pixels, on black."""
    size = size or (pictures[0].shape[1], pictures[0].shape[0])
    back = np.linalg.inv(moved)
    made = [
        np.asarray(
            Image.fromarray(picture).transform(
                size,
                Image.Transform.PERSPECTIVE,
                tuple((back / back[2, 2]).ravel()[:8]),
                Image.Resampling.BICUBIC,
            )
        )
        for picture in pictures
    ]
    return made, moved


def _scaled(
    sideways: float, down: float, right: float = 0, below: float = 0
) -> NDArray[np.float64]:
    return np.array([[sideways, 0, right], [0, down, below], [0, 0, 1.0]])


def _turning(degrees: float, right: float = 0.0, size: tuple[int, int] = (1280, 720)) -> Any:
    """A turn about the middle of a picture."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    middle = _scaled(1, 1, size[0] / 2 + right, size[1] / 2)
    return (
        middle
        @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        @ _scaled(1, 1, -size[0] / 2, -size[1] / 2)
    )


def _turn(degrees: float) -> Callable[[Pictures], Any]:
    return lambda pictures: _warp(pictures, _turning(degrees))


def _quarter(pictures: Pictures) -> Any:
    height = pictures[0].shape[0]
    moved = np.array([[0, -1, height], [1, 0, 0], [0, 0, 1.0]])
    return [np.ascontiguousarray(np.rot90(picture, -1)) for picture in pictures], moved


def _mirror(pictures: Pictures) -> Any:
    moved = _scaled(-1, 1, pictures[0].shape[1])
    return [np.ascontiguousarray(picture[:, ::-1]) for picture in pictures], moved


def _tilt(degrees: float) -> Callable[[Pictures], Any]:
    """Seen from the player's side at an angle, by a camera with a usual lens."""

    def make(pictures: Pictures) -> Any:
        height, width = pictures[0].shape[:2]
        focal = 1.2 * width
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        to_plane = _scaled(1, 1, -width / 2, -height / 2)
        # The far side of the picture moves away from the camera.
        seen = np.array([[focal, 0, 0], [0, focal * c, 0], [0, -s, focal * 1.25]])
        return _warp(pictures, _scaled(1, 1, width / 2, height / 2) @ seen @ to_plane)

    return make


def _light(*factors: float) -> Callable[[Pictures], Any]:
    def make(pictures: Pictures) -> Any:
        lit = [
            np.clip(picture * np.array(factors), 0, 255).astype(np.uint8) for picture in pictures
        ]
        return lit, np.eye(3)

    return make


def _shade(pictures: Pictures) -> Any:
    shaded = [picture.copy() for picture in pictures]
    for picture in shaded:
        picture[:, 1080:] = picture[:, 1080:] * 0.12
    return shaded, np.eye(3)


def _crf_40(pictures: Pictures) -> Any:
    """Written and read as a film of little data."""
    height, width = pictures[0].shape[:2]
    with TemporaryDirectory() as folder:
        path = Path(folder, "film.mp4")
        with av.open(str(path), "w") as container:
            stream = container.add_stream("libx264", rate=5, options={"crf": "40"})
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            for picture in pictures:
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture)))
            container.mux(stream.encode())
        return Film(path).sample(_COUNT), np.eye(3)


def _watermark(pictures: Pictures) -> Any:
    marked = []
    for picture in pictures:
        image = Image.fromarray(picture)
        pen = ImageDraw.Draw(image)
        pen.text((40, 40), "A CHANNEL OF PIANO FILMS", fill=(255, 255, 255), font_size=48)
        pen.text((760, 380), "subscribe", fill=(255, 255, 255), font_size=64)
        marked.append(np.asarray(image))
    return marked, np.eye(3)


def _letterbox(pictures: Pictures) -> Any:
    return _warp(pictures, _scaled(0.75, 0.75, 160, 90))


def _title(part: float) -> Any:
    """A fifth of the film is a title card."""
    return None if part < 0.2 else np.eye(3)


def _cut(part: float) -> Any:
    """Two fifths are nearer."""
    return np.eye(3) if part < 0.6 else _scaled(1.4, 1.4, -256, -144)


def _shake(part: float) -> Any:
    """By up to 4 pixels, from each frame to the next."""
    draw = np.random.default_rng(round(1e6 * part))
    return _scaled(1, 1, *draw.uniform(-4, 4, 2))


def _drift(part: float) -> Any:
    """Held in a hand: it turns by 3 degrees and moves by 25 pixels from beginning to end."""
    return _turning(3 * (part - 0.5), 25 * (part - 0.5))


def _unsteady(part: float) -> Any:
    """The same, and it sways, turns and nears as hands do, within a second."""
    at = part * _SECONDS
    sway = _scaled(1, 1, 6 * np.sin(5 * at), 4 * np.sin(7.3 * at + 1))
    near = 1 + 0.01 * np.sin(4.1 * at)
    middle = _scaled(1, 1, 640, 360) @ _scaled(near, near) @ _scaled(1, 1, -640, -360)
    return sway @ middle @ _drift(part) @ _turning(0.5 * np.sin(6.1 * at))


MOVING: dict[str, Callable[[float], Any]] = {
    "title card": _title,
    "cut with zoom": _cut,
    "shake of 4 pixels": _shake,
    "hand-held drift": _drift,
    "hand-held, unsteady": _unsteady,
}
"""Variants whose camera moves: by part of the film, 0..1, the homography; None for a card."""
VARIANTS: dict[str, Callable[[Pictures], Any]] = {
    "as it is": _light(1, 1, 1),
    "right 60 %": lambda p: _warp(p, _scaled(1, 1, -512), (768, 720)),
    "left 60 %": lambda p: _warp(p, np.eye(3), (768, 720)),
    "turned 7 degrees": _turn(7),
    "turned 15 degrees": _turn(15),
    "turned 90 degrees": _quarter,
    "turned 180 degrees": _turn(180),
    "mirrored": _mirror,
    "tilted 30 degrees": _tilt(30),
    "tilted 45 degrees": _tilt(45),
    "640 x 360": lambda p: _warp(p, _scaled(0.5, 0.5), (640, 360)),
    "35 % brightness": _light(0.35, 0.35, 0.35),
    "15 % brightness": _light(0.15, 0.15, 0.15),
    "warm": _light(1.1, 0.85, 0.5),
    "crf 40": _crf_40,
    "24 frames/s": _light(1, 1, 1),
    "15 frames/s": _light(1, 1, 1),
    "10 frames/s": _light(1, 1, 1),
    "watermark": _watermark,
    "letterbox": _letterbox,
    "an octave in shade": _shade,
}
"""The variants: pictures, and the homography of pixels by which they were moved."""


if __name__ == "__main__":
    main()
