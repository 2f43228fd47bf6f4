"""Videos of a keyboard and hands of which everything is known."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from pianomime.keyboard import BLACK
from pianomime.music import Score
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.video.drawing import key_outline
from pianomime.video.hands.sightings import Sighting
from pianomime.video.keyboard.plane import Plane, fit_plane

RATE = 20.0
Moved = Callable[[float], NDArray[np.float64] | None]
"""(3, 3) homography by which pixels are moved at a time [s]; None for another picture."""
SKIN = (224, 172, 140)
LIT = (60, 210, 90)


def song(seconds: float = 5.0, seed: int = 1) -> Score:
    """Both hands, five notes each, one after the other, beginning at 0.5 s."""
    draw = np.random.default_rng(seed)
    onset = np.arange(0.5, seconds - 0.6, 0.25)
    right = draw.choice([39, 41, 43, 44, 46, 48], len(onset))
    left = draw.choice([20, 22, 24, 25, 27], len(onset[::2]))
    key = np.concatenate((right, left))
    begin = np.concatenate((onset, onset[::2]))
    return Score(key, begin, begin + 0.2, np.full(len(key), 80), title="made up")


def camera(
    size: tuple[int, int] = (1280, 720),
    turned: float = 0.0,
    mirrored: bool = False,
    span: tuple[float, float] = (-0.63, 0.63),
    tilt: float = 0.0,
) -> Plane:
    """A camera over the keyboard.

    Args:
        size: of its pictures [pixels].
        turned: clockwise [degrees].
        mirrored: left and right changed.
        span: world y of the left and right edges of the picture, before it is turned [m].
        tilt: how much larger the player's side is, per metre.
    """
    width, height = size
    scale = width / (span[1] - span[0])
    corners = np.array([[-0.1, -0.6], [-0.1, 0.6], [0.1, -0.6], [0.1, 0.6]])
    grown = 1 + tilt * corners[:, 0]
    middle = (span[0] + span[1]) / 2
    u = scale * (corners[:, 1] - middle) * grown
    v = scale * corners[:, 0] * grown
    angle = np.radians(turned)
    column = u * np.cos(angle) - v * np.sin(angle)
    row = u * np.sin(angle) + v * np.cos(angle)
    if mirrored:
        column = -column
    return fit_plane(np.stack((column + width / 2, row + 0.45 * height), axis=1), corners)


def picture(
    plane: Plane,
    size: tuple[int, int],
    lit: Sequence[int] = (),
    hands: NDArray[np.float64] | None = None,
) -> NDArray[np.uint8]:
    """(height, width, 3) the keyboard, some keys lit, and perhaps hands (2, 6, 2) over it."""
    over = 2  # drawn twice as large and shrunk, for smooth edges
    large = Image.new("RGB", (size[0] * over, size[1] * over), (24, 22, 20))
    pen = ImageDraw.Draw(large)

    def corners(world: NDArray[np.float64]) -> list[tuple[float, float]]:
        return [(float(x), float(y)) for x, y in plane.to_pixels(world) * over]

    for black in (False, True):
        for key in np.flatnonzero(black == BLACK):
            outline = key_outline(int(key))
            if not black:
                outline = outline + np.array([[0, 1], [0, -1], [0, -1], [0, 1]]) * 0.0006
            colour = LIT if key in lit else ((20, 20, 22) if black else (232, 232, 228))
            pen.polygon(corners(outline), fill=colour)
    if hands is not None:
        for hand in hands:
            _draw_hand(pen, plane.to_pixels(hand) * over)
    return np.asarray(large.resize(size, Image.Resampling.BOX), np.uint8)


def _draw_hand(pen: ImageDraw.ImageDraw, points: NDArray[np.float64]) -> None:
    wrist, tips = points[0], points[1:]
    length = float(np.linalg.norm(tips[2] - wrist))
    width = 0.1 * length
    roots = wrist + np.array([[0.35], [0.6], [0.6], [0.58], [0.55]]) * (tips - wrist)
    pen.polygon([tuple(each) for each in (wrist, *roots)], fill=SKIN)
    pen.line([tuple(wrist), tuple(roots[2])], fill=SKIN, width=int(4.5 * width))
    for root, tip in zip(roots, tips, strict=True):
        pen.line([tuple(root), tuple(tip)], fill=SKIN, width=int(width))
        for end in (root, tip):
            pen.ellipse([tuple(end - width / 2), tuple(end + width / 2)], fill=SKIN)


def times(seconds: float, fps: float, seed: int | None = None) -> NDArray[np.float64]:
    """When frames are shown; with a seed, at a rate that varies."""
    if seed is None:
        return np.arange(round(seconds * fps)) / fps
    gaps = np.random.default_rng(seed).uniform(0.4, 1.6, round(seconds * fps)) / fps
    return np.concatenate(([0.0], np.cumsum(gaps)[:-1]))


def write(
    path: Path,
    plane: Plane,
    size: tuple[int, int],
    score: Score,
    plan: FingertipPlan,
    shown: NDArray[np.float64],
    light_up: bool = True,
    moved: Moved = lambda _: np.eye(3),
) -> None:
    """Write a video of the score being played; frames are `shown` at these times [s]."""
    with av.open(str(path), "w") as film:
        stream: Any = film.add_stream("libx264", rate=60)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        stream.time_base = Fraction(1, 6000)
        stream.codec_context.time_base = Fraction(1, 6000)
        stream.options = {"crf": "18", "preset": "ultrafast"}
        for at in shown:
            sounding = score.key[(score.onset <= at) & (at < score.offset)]
            row = min(int(at * RATE), len(plan) - 1)
            hands = plan.fingertips[row, :, :, :2]
            way = moved(at)
            if way is None:
                seen = np.full((size[1], size[0], 3), 200, np.uint8)
            else:
                seen = picture(after(plane, way), size, sounding if light_up else (), hands)
            frame = av.VideoFrame.from_ndarray(seen, format="rgb24")
            frame.pts, frame.time_base = round(at * 6000), Fraction(1, 6000)
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))


def after(plane: Plane, moved: NDArray[np.float64]) -> Plane:
    """The plane in a picture that is moved."""
    return Plane(plane.matrix @ np.linalg.inv(moved))


def turn(degrees: float, right: float, size: tuple[int, int]) -> NDArray[np.float64]:
    """A turn about the middle of a picture, and then a move [pixels]."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    u, v = size[0] / 2, size[1] / 2
    return np.array([[c, -s, u - c * u + s * v + right], [s, c, v - s * u - c * v], [0, 0, 1]])


def plan_of(score: Score) -> FingertipPlan:
    """Hands that play the score."""
    return ZeroShotPlanner().plan(score)


class TrueHands:
    """Stands in for MediaPipe: returns where the hands were drawn, with noise and mistakes.

    Args:
        plane: of the video's pictures.
        size: of the video's pictures [pixels].
        points: (T, 2, 6, 2) world x, y [m] where the hands seem to be, 20 frames a second.
        noise: standard deviation [m].
        moved: how the pictures are moved.
    """

    def __init__(
        self,
        plane: Plane,
        size: tuple[int, int],
        points: NDArray[np.float64],
        noise: float = 0.001,
        moved: Moved = lambda _: np.eye(3),
    ) -> None:
        self._moved = moved
        self._plane, self._size, self._points, self._noise = plane, size, points, noise
        self._draw = np.random.default_rng(0)

    def __enter__(self) -> TrueHands:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def detect(self, _: NDArray[np.uint8], milliseconds: int) -> list[Sighting]:
        row = min(int(milliseconds * RATE / 1000 + 0.5), len(self._points) - 1)
        points = self._points[row]
        points = points + self._draw.normal(0, self._noise, points.shape)
        way = self._moved(milliseconds / 1000)
        if way is None:
            return []
        seen = after(self._plane, way).to_pixels(points) / self._size
        sightings = [Sighting(seen[0], 0.1), Sighting(seen[1], 0.9)]
        luck = self._draw.random()
        if luck < 0.02:
            return sightings[1:]
        if luck < 0.04:  # left taken for right, and the other way round
            return [Sighting(seen[0], 0.9), Sighting(seen[1], 0.1)]
        return sightings


def frames(path: Path) -> Iterator[Any]:
    """The pictures of a video."""
    with av.open(str(path)) as film:
        yield from film.decode(video=0)
