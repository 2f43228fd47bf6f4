"""Named points of the keyboard in a video, in a JSON file that a person has made.

The file holds one object, `{"points": {NAME: [COLUMN, ROW], ...}}`, in pixels of the video. A name
is a key and one of its corners, such as "A0 front left" or "C4 back right", or the middle of the
front edge of a black key, such as "F#3 front". Front is toward the player, left is the bass.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError, UnknownNameError, closest
from pianomime.keyboard import BLACK, KEYS, key_name
from pianomime.schema import Field, NamedBy, check_json
from pianomime.sealed_json import parse_json
from pianomime.video.keyboard.geometry import FAR, FRONT, LEFT_EDGE, WHITE_WIDTH
from pianomime.video.keyboard.plane import Plane, fit_plane_robustly
from pianomime.world.parameters import key_centres, key_half_sizes

# In names that people type, a sharp is written as "#".
_KEY_OF_NAME = {key_name(key).replace("♯", "#"): key for key in range(KEYS)}
_NAME = re.compile(r"([A-G]#?\d) (front|back)(?: (left|right))?")

_SCHEMA = {"points": NamedBy(Field("float", (2,), -1e6, 1e6))}
"""Points by name, each a column and a row in pixels, perhaps beyond the picture."""
_FEWEST, _MOST = 4, 1000

SUGGESTED = (
    "A0 front left",
    "C8 front right",
    "A0 back left",
    "C8 back right",
    "C4 front left",
    "C4 back left",
    "F#2 front",
    "F#6 front",
)
"""Names of eight points that are easy to see and far apart, as in the paper."""


@dataclass(frozen=True, eq=False)
class NamedPoints:
    """A plane fitted to named points.

    Attributes:
        plane: plane of the keyboard in the video.
        names: names of the points that agree with it.
        left_out: names of the others.
        error_metres: median error of the points that agree [m].
    """

    plane: Plane
    names: list[str]
    left_out: list[str]
    error_metres: float

    def describe(self) -> str:
        """One line for the user: how many points, and how well they fit one plane."""
        within = f", within {self.error_metres * 1000:.1f} mm"
        return f"{len(self.names)} points{within}{self._left_out()}"

    def describe_points(self) -> str:
        """How many points; they would fit one plane as well if all were named wrongly."""
        return f"{len(self.names)} marked points{self._left_out()}"

    def _left_out(self) -> str:
        return f"; left out: {', '.join(self.left_out)}" if self.left_out else ""


def place_of(name: str) -> NDArray[np.float64]:
    """(2,) World x, y of a named point [m].

    Args:
        name: name of a point, such as "C4 front left".

    Raises:
        UnknownNameError: there is no such point.
    """
    match = _NAME.fullmatch(name.strip())
    key = None if match is None else _KEY_OF_NAME.get(match[1])
    if match is None or key is None or (match[3] is None and not BLACK[key]):
        hint = closest(name, SUGGESTED) or ";"
        raise UnknownNameError(
            f"{name!r} is not a point of a keyboard{hint} names are like {SUGGESTED[0]!r} or "
            f"{SUGGESTED[-1]!r}"
        )
    centre, half = key_centres()[key], key_half_sizes()[key]
    side = {"left": -1, None: 0, "right": 1}[match[3]]
    if BLACK[key]:
        x = centre[0] + half[0] if match[2] == "front" else FAR
        return np.array([x, centre[1] + side * half[1]])
    # The middle of the gap between white keys, which is what one sees.
    white = int((~BLACK[:key]).sum()) + (side + 1) / 2
    return np.array([FRONT if match[2] == "front" else FAR, LEFT_EDGE + WHITE_WIDTH * white])


def read_points(path: Path) -> NamedPoints:
    """Read a file of named points, and fit a plane to those that agree.

    Args:
        path: the JSON file.

    Raises:
        InputError: the file cannot be read, or does not hold at least four points, well apart.
    """
    try:
        text = path.read_text("utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: does not exist") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read") from error
    return parse_points(text, path)


def parse_points(text: str, path: Path) -> NamedPoints:
    """Fit a plane to the named points in a text.

    Args:
        text: content of a file of named points.
        path: the file, for messages.

    Raises:
        InputError: it does not hold at least four points, well apart.
    """
    try:
        content = parse_json(text)
        check_json(content, _SCHEMA)
    except InputError as error:
        raise InputError(
            f'{path}: must hold {{"points": {{NAME: [COLUMN, ROW], ...}}}} ({error})'
        ) from error
    names = list(content["points"])
    pixels = np.array(list(content["points"].values()), np.float64).reshape(-1, 2)
    if not _FEWEST <= len(names) <= _MOST:
        raise InputError(f"{path}: at least {_FEWEST} points of two finite numbers are needed")
    world = np.array([place_of(name) for name in names])
    try:
        plane, good = fit_plane_robustly(pixels, world)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise InputError(
            f"{path}: the points do not determine where the keyboard is: {error}"
        ) from error
    off = np.linalg.norm(plane.to_world(pixels) - world, axis=1)
    return NamedPoints(
        plane,
        [name for name, fits in zip(names, good, strict=True) if fits],
        [name for name, fits in zip(names, good, strict=True) if not fits],
        float(np.median(off[good])),
    )
