"""Evidence of white keys along a keyboard in a picture, and beyond its ends.

Each place is compared with the octave that the keyboard shows on average, so light, colour and
make of the piano matter little.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.short_repr import short_repr
from pianomime.video.keyboard.geometry import BLACK_FRONT, FAR, FRONT, LEFT_EDGE, WHITE_WIDTH
from pianomime.video.keyboard.lines import sample
from pianomime.video.keyboard.plane import Plane

_ACROSS = 16
"""Samples along a white key's width."""
_AROUND = 60
"""[white keys] How far beyond the keyboard the picture is looked at."""
_BACK_ROWS, _FRONT_ROWS = 8, 6
"""Rows of samples across the keys: where the black keys are, and in front of them."""
_OCTAVE = 7
_PART = 0.4
"""Least part of a white key's place that must be in the picture."""
_SLIP, _FURTHEST = 2, 12
"""Samples by which a place may be off the one before it, and off the plane."""
_SURELY = 0.6
"""Likeness from which a place is followed."""
_FAINT = 0.008
"""Standard deviation of brightness, 0..1, below which a place shows nothing."""
_BLACK = 0.5
"""Brightness, of that of white, below which the average octave is black."""


@dataclass(frozen=True, eq=False)
class KeyEvidence:
    """What the picture says about the places of white keys along the keyboard, and beyond it.

    Attributes:
        first: number of the first place, in white keys from the plane's lowest one.
        likeness: (P,) correlation with the keyboard's average octave; NaN outside the picture.
        faint: (P,) bool, whether the place shows nothing.
        part: (P,) part of the place that is in the picture.
        bare: (P, 2) logarithm of the odds that the black key at the left and at the right of a
            place, where the average octave has one, is missing, as beside A0 and C8; 0 where there
            is none, or it is outside the picture.
    """

    first: int
    likeness: NDArray[np.float64]
    faint: NDArray[np.bool_]
    part: NDArray[np.float64]
    bare: NDArray[np.float64]

    __repr__ = short_repr

    def odds(self) -> NDArray[np.float64]:
        """(P,) Logarithm of the odds that there is a key at each place; 0 outside the picture.

        Something else than a key may be a hand or a light on one, so it counts half as much as a
        key does, and a place that is dark hardly counts. Of a key, less counts the less of it is in
        the picture; what is no key is none, however little of it is seen.
        """
        odds = np.clip(8 * (self.likeness - 0.45), -1.5, 3.0)
        odds = np.where(self.faint, -0.1, odds)
        odds = np.nan_to_num(odds)
        odds = np.where(odds > 0, odds * self.part, odds)
        return np.asarray(np.where(self.part >= _PART, odds, 0.0))

    def hidden(self) -> int:
        """Number of places between the outermost keys that are seen where no key is seen."""
        odds = self.odds()
        keys = np.flatnonzero(odds > 0)
        return int((odds[keys[0] : keys[-1]] < 0).sum()) if len(keys) else 0


def look_along(picture: NDArray[np.float32], plane: Plane, known: NDArray[np.int64]) -> KeyEvidence:
    """Look along a keyboard and beyond its ends.

    Args:
        picture: (height, width) brightness, 0..1.
        plane: plane of the keyboard in any octave.
        known: (2,) numbers of the first and the last white key that are certainly of the keyboard.
    """
    first, end = int(known[0]) - _AROUND, int(known[1]) + _AROUND + 1
    strip = _strip(picture, plane, first, end)
    octave = _average_octave(strip, known - first)
    # Which step of that octave each place is.
    step = (np.arange(first, end) - known[0]) % _OCTAVE
    likeness, part = np.full(end - first, np.nan), np.zeros(end - first)
    faint = np.zeros(end - first, bool)
    bare = np.zeros((end - first, 2))
    start = int(known.mean()) - first
    # Outward from the middle, so that bent pictures are followed.
    for places in (range(start, -1, -1), range(start, end - first)):
        slip = 0
        for at in places:
            ways = [
                (*like, moved)
                for moved in range(max(slip - _SLIP, -_FURTHEST), min(slip + _SLIP, _FURTHEST) + 1)
                if (like := _likeness(strip, at * _ACROSS + moved, octave[step[at]])) is not None
            ]
            if not ways:
                continue
            likeness[at], part[at], spread, moved = max(ways)
            faint[at] = spread < _FAINT
            if not faint[at]:
                # Where the place before it says it is: what is dark beyond an end is no black key.
                bare[at] = _bare(strip, at * _ACROSS + slip, octave[step[at]])
            if likeness[at] > _SURELY and not faint[at]:
                slip = moved
    return KeyEvidence(first, likeness, faint, part, bare)


def _strip(picture: NDArray[np.float32], plane: Plane, first: int, end: int) -> NDArray[np.float64]:
    """(R, S) Brightness on the keys, in rows across them, from white key `first` to before `end`.

    NaN outside the picture.
    """
    along = LEFT_EDGE + WHITE_WIDTH * (np.arange(first, end, 1 / _ACROSS) + 0.5 / _ACROSS)
    margin = 0.012  # [m] ends of keys look different on each piano
    across = np.concatenate(
        (
            np.linspace(FAR + margin, BLACK_FRONT - margin, _BACK_ROWS),
            np.linspace(BLACK_FRONT + margin, FRONT - margin, _FRONT_ROWS),
        )
    )
    world = np.stack(np.broadcast_arrays(across[:, None], along[None]), axis=-1)
    strip = sample(picture, plane.to_pixels(world))
    # Beyond the horizon of a tilted picture there is nothing.
    horizon = np.linalg.inv(plane.matrix)[2]
    depth = world @ horizon[:2] + horizon[2]
    strip[depth * np.median(depth) <= 0] = np.nan
    return strip


def _average_octave(strip: NDArray[np.float64], known: NDArray[np.int64]) -> NDArray[np.float64]:
    """(7, R, _ACROSS) What the places of an octave look like, from the first known one on.

    Args:
        strip: brightness on the keys.
        known: (2,) the first and the last place in it that are certainly of keys.
    """
    low, high = known[0] * _ACROSS, (known[1] + 1) * _ACROSS
    places = np.stack(np.split(strip[:, low:high], known[1] + 1 - known[0], axis=1))
    octave = np.full((_OCTAVE, *places.shape[1:]), np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of what is outside the picture
        # Light differs from place to place.
        level = np.nanmedian(places, axis=(1, 2), keepdims=True)
        places = places / np.maximum(level, 1e-3)
        for step in range(min(_OCTAVE, len(places))):
            octave[step] = np.nanmedian(places[step::_OCTAVE], axis=0)
    return octave


def _likeness(
    strip: NDArray[np.float64], left: int, model: NDArray[np.float64]
) -> tuple[float, float, float] | None:
    """Correlation of a place with a model, part of it in the picture, and spread of brightness."""
    if left < 0 or left + _ACROSS > strip.shape[1]:
        return None
    place = strip[:, left : left + _ACROSS]
    both = np.isfinite(place) & np.isfinite(model)
    if both.mean() < _PART:
        return None
    seen, wanted = place[both], model[both]
    spread = float(seen.std())
    some = spread * float(wanted.std())
    like = float(np.mean((seen - seen.mean()) * (wanted - wanted.mean()))) / max(some, 1e-9)
    return like, float(both.mean()), spread


def _bare(strip: NDArray[np.float64], left: int, model: NDArray[np.float64]) -> tuple[float, float]:
    """`KeyEvidence.bare` of a place."""
    if left < 0 or left + _ACROSS > strip.shape[1]:
        return 0.0, 0.0
    rows = slice(0, _BACK_ROWS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of what is outside the picture
        place = np.nanmedian(strip[rows, left : left + _ACROSS], axis=0)
        wanted = np.nanmedian(model[rows], axis=0)
    if not np.isfinite(wanted).any():
        return 0.0, 0.0
    white = float(np.nanmax(wanted))
    black = wanted < _BLACK * white
    lit = np.isfinite(place) & ~black
    if not lit.any():
        return 0.0, 0.0
    middle = _ACROSS // 2
    odds = []
    for side in (slice(0, middle), slice(middle, _ACROSS)):
        there = np.flatnonzero(np.isfinite(place[side]) & black[side])
        if not len(there):
            odds.append(0.0)
            continue
        missing = 1 - float(wanted[side][there].mean()) / white
        dark = 1 - float(place[side][there].mean()) / max(float(place[lit].mean()), _FAINT)
        odds.append(float(np.clip(8 * (0.5 - dark / missing), -3.0, 3.0)))
    return odds[0], odds[1]
