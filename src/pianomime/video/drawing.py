"""Drawing of key grid, hands and pressed keys into pictures of the video."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from pianomime.keyboard import BLACK, KEYS, NO_KEY, key_name
from pianomime.palette import DARK, rgb
from pianomime.plan import LEFT
from pianomime.video.keyboard.geometry import BLACK_FRONT, FAR, FRONT, WHITE_WIDTH
from pianomime.video.keyboard.plane import Plane
from pianomime.video.keyboard.track import KeyboardTrack
from pianomime.world.parameters import key_centres, key_half_sizes

# Bright, because they are seen on pictures that are dark in many places.
_HANDS = tuple(rgb(colour) for colour in DARK.hands[:2])
_LOST = rgb(DARK.wrong)
"""Colour of hands that were not seen."""
_GRID = (90, 255, 120)
"""Colour of the outlines of the keys."""


def key_outline(key: int) -> NDArray[np.float64]:
    """(4, 2) World x, y of a key's corners, clockwise from the far bass corner [m]."""
    _, y, _ = key_centres()[key]
    half = key_half_sizes()[key, 1] if BLACK[key] else WHITE_WIDTH / 2
    front = BLACK_FRONT if BLACK[key] else FRONT
    return np.array([[FAR, y - half], [FAR, y + half], [front, y + half], [front, y - half]])


def draw_keys(picture: NDArray[np.uint8], plane: Plane) -> NDArray[np.uint8]:
    """Draw the outlines of the keys, and the names of the Cs.

    Args:
        picture: (height, width, 3) uint8; it is not changed.
        plane: plane of the keyboard in it.

    Returns:
        (height, width, 3) uint8.
    """
    image = Image.fromarray(picture).convert("RGB")
    pen = ImageDraw.Draw(image, "RGBA")
    for key in range(KEYS):
        outline = plane.to_pixels(key_outline(key))
        pen.polygon(_corners(outline), outline=(*_GRID, 160))
        if key_name(key).startswith("C") and not BLACK[key]:
            width = float(np.linalg.norm(outline[2] - outline[3]))
            pen.text(
                tuple(outline.mean(axis=0) * 0.3 + (outline[2] + outline[3]) * 0.35),
                key_name(key),
                fill=(255, 255, 255),
                anchor="mm",
                font_size=max(8.0, 0.7 * width),
                stroke_width=2,
                stroke_fill=(0, 0, 0),
            )
    return np.asarray(image, np.uint8)


class Drawing:
    """Draws into pictures of one video."""

    def __init__(self, track: KeyboardTrack) -> None:
        """Prepare to draw.

        Args:
            track: of the keyboard.
        """
        self._track = track
        self._plane: Plane | None = None

    def draw(
        self,
        frame: int,
        picture: NDArray[np.uint8],
        points: NDArray[np.floating],
        found: NDArray[np.bool_],
        finger_key: NDArray[np.int8],
    ) -> NDArray[np.uint8]:
        """Draw key grid, hands, pressed keys and the finger on each.

        Args:
            frame: number of the frame; where no keyboard is seen, nothing is drawn.
            picture: (height, width, 3) uint8; it is not changed.
            points: (2, 6, 2) world x, y of both hands' points [m].
            found: (2,) bool, hands that were seen; the others are drawn in another colour.
            finger_key: (2, 5) key that each finger presses, -1 for none.

        Returns:
            (height, width, 3) uint8.
        """
        plane = self._track.at(frame)
        if plane is None:
            return picture
        if plane is not self._plane:
            self._plane = plane
            self._outlines = [plane.to_pixels(key_outline(key)) for key in range(KEYS)]
        image = Image.fromarray(picture).convert("RGB")
        pen = ImageDraw.Draw(image, "RGBA")
        for outline in self._outlines:
            pen.polygon(_corners(outline), outline=(*_GRID, 90))
        places = plane.to_pixels(points)
        radius = max(3.0, picture.shape[1] / 320)
        for hand, colour in enumerate(_HANDS):
            for finger, key in enumerate(finger_key[hand]):
                if key != NO_KEY:
                    outline = self._outlines[key]
                    pen.polygon(_corners(outline), fill=(*colour, 110), outline=(*colour, 255))
                    foot = (outline[2] + outline[3]) / 2
                    label = f"{'L' if hand == LEFT else 'R'}{finger + 1}"
                    pen.text(
                        tuple(foot),
                        label,
                        fill=(255, 255, 255),
                        anchor="ms",
                        font_size=5 * radius,
                        stroke_width=2,
                        stroke_fill=(0, 0, 0),
                    )
            mark = colour if found[hand] else _LOST
            wrist = tuple(places[hand, 0])
            for finger in range(1, 6):
                tip = places[hand, finger]
                pen.line([wrist, tuple(tip)], fill=(*mark, 150), width=2)
                pressing = finger_key[hand, finger - 1] != NO_KEY
                size = radius * (1.6 if pressing else 1.0)
                box = [tuple(tip - size), tuple(tip + size)]
                pen.ellipse(box, fill=(*mark, 230 if pressing else 120), outline=(0, 0, 0))
        return np.asarray(image, np.uint8)


def _corners(outline: NDArray[np.float64]) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in outline]
