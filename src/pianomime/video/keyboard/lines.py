"""Detection of a keyboard in a picture by the pattern of its black keys.

Lines are laid across the picture at several angles. Where a line crosses black keys, the dark
segments on it come in groups of two and three, which determines the width of the keys and the
position of every C. Many such lines side by side are a keyboard.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import (
    gaussian_filter,
    gaussian_filter1d,
    map_coordinates,
    maximum_filter1d,
    minimum_filter1d,
    uniform_filter1d,
)

from pianomime.short_repr import short_repr

# Positions of the black keys of an octave, in widths of a white key from the left edge of C. Pianos
# differ by a tenth either way; simulated black keys are exactly on the edges of white keys.
_BLACK_AT = np.array([0.94, 2.06, 3.92, 5.0, 6.08])
_OFF = 0.22
"""[white keys] Greatest distance of a black key from its position."""
_WIDTHS = (0.25, 0.85)
"""[white keys] Range of the width of a black key."""
_CONTRAST = (0.04, 0.12, 0.25)
"""Least difference of the brightness of black and white keys: at least, at most, and part of the
brightness of white keys."""
_FEWEST = 5
"""Least number of black keys on a line."""
_NARROWEST = 5
"""[pixels] Least width of a white key."""
_SMALLEST = 8
"""[pixels] Least height and width of a picture in which there can be a keyboard."""
_GUESSES = 8
"""Hypotheses about a line that are refined."""
_LINES = 150
"""Lines at each angle."""
_ANGLES = np.arange(-10, 11, 2.0)
"""[degrees] Angles of the lines with the horizontal, and with the vertical."""
_OTHER_ANGLES = 3
"""Further angles, those of most edges in the picture, that are searched with their neighbours."""
_COARSE = 640
"""[pixels] Longer side of the picture, about, in which the angle is searched."""


@dataclass(frozen=True, eq=False)
class Lines:
    """A keyboard found along lines across the picture.

    Coordinates (s, r) are at `origin + s * along + r * across` [pixels]. Edges of white keys are
    at s = start(r) + width(r) * u for integers u, and u = 0, 7, 14 ... are the left edges of a C
    (in a mirrored picture, 3 - u).

    Attributes:
        origin: (2,) column, row of s = r = 0 [pixels].
        along: (2,) unit vector along the lines.
        across: (2,) unit vector from line to line.
        start: (2,) value at r = 0 and slope of start(r) [pixels].
        width: (2,) value at r = 0 and slope of width(r) [pixels].
        rows: first and last r that cross black keys [pixels].
        blacks: indices of the black keys found, five per octave; index 0 is the black key on the
            right edge of the C at u = 0.
        score: sum of the scores of the lines.
    """

    origin: NDArray[np.float64]
    along: NDArray[np.float64]
    across: NDArray[np.float64]
    start: NDArray[np.float64]
    width: NDArray[np.float64]
    rows: tuple[float, float]
    blacks: NDArray[np.int64]
    score: float

    __repr__ = short_repr

    def pixels(self, u: NDArray[np.float64], r: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., 2) Column, row of coordinates u along the keyboard and r across it."""
        s = self.start[0] + self.start[1] * r + (self.width[0] + self.width[1] * r) * u
        places: NDArray[np.float64] = (
            self.origin + s[..., None] * self.along + r[..., None] * self.across
        )
        return places


def black_place(number: NDArray[np.int64]) -> NDArray[np.float64]:
    """Coordinates u of black keys, given their indices as in `Lines.blacks`."""
    return np.asarray(_BLACK_AT[number % 5] + 7 * (number // 5))


def sample(picture: NDArray[np.float32], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Brightness at points of a picture, by linear interpolation.

    Args:
        picture: (height, width).
        places: (..., 2) column, row, measured from the outer corner of the top left pixel.

    Returns:
        (...) brightness; NaN outside the picture.
    """
    at = np.moveaxis(places[..., ::-1] - 0.5, -1, 0)
    return np.asarray(map_coordinates(picture, at, order=1, mode="constant", cval=np.nan))


def find_lines(picture: NDArray[np.float32]) -> Lines | None:
    """Find the keyboard in a picture.

    Args:
        picture: (height, width) brightness, 0..1.

    Returns:
        The lines with the highest score; None if there is no keyboard.
    """
    if min(picture.shape) < _SMALLEST:
        return None
    # At half the size and on half the lines, one angle takes a quarter of the time.
    factor = max(1, round(max(picture.shape) / _COARSE))
    small = _shrunk(picture, factor)
    found = _best(small, _angles(small), _LINES // 2)
    if found is None:
        # Keys may be too narrow for that.
        return _best(picture, _angles(picture), _LINES) if factor > 1 else None
    angle = np.degrees(np.arctan2(found.along[1], found.along[0]))
    return _best(picture, np.array([angle]), _LINES)


def _best(picture: NDArray[np.float32], angles: NDArray[np.float64], count: int) -> Lines | None:
    """The keyboard with the highest score, on `count` lines at each of the angles [degrees]."""
    best: Lines | None = None
    for angle in np.radians(angles):
        found = _at_angle(picture, float(angle), count)
        if found is not None and (best is None or found.score > best.score):
            best = found
    return best


def _shrunk(picture: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """The picture at 1 / factor of its size."""
    height, width = (size // factor for size in picture.shape)
    blocks = picture[: height * factor, : width * factor].reshape(height, factor, width, factor)
    return np.asarray(blocks.mean(axis=(1, 3)), np.float32)


def _angles(picture: NDArray[np.float32]) -> NDArray[np.float64]:
    """Angles [degrees] at which a keyboard may lie: near the picture's sides, and as most edges."""
    usual = (_ANGLES + np.array([[0.0], [90.0]])).ravel()
    smooth = gaussian_filter(np.asarray(picture, np.float64), 1.0)
    down, right = np.gradient(smooth)
    # Keys are rectangles: their long and their short sides are at one angle, modulo 90 degrees.
    angle = np.degrees(np.arctan2(down, right)) % 90
    weight = np.hypot(down, right)
    edges = np.histogram(angle, 90, (0, 90), weights=np.where(weight > 0.01, weight, 0))[0]
    edges = gaussian_filter1d(edges, 1.0, mode="wrap")
    peaks = np.flatnonzero(edges == maximum_filter1d(edges, 7, mode="wrap"))
    peaks = peaks[(peaks > _ANGLES[-1]) & (peaks < 90 + _ANGLES[0]) & (edges[peaks] > 0)]
    peaks = peaks[np.argsort(-edges[peaks], kind="stable")][:_OTHER_ANGLES]
    other = (peaks[:, None] + 0.5 + np.array([-2.0, 0.0, 2.0])).ravel()
    return np.concatenate((usual, other, other + 90))


def _at_angle(picture: NDArray[np.float32], angle: float, count: int) -> Lines | None:
    """The keyboard on `count` lines at one angle [rad]."""
    height, width = picture.shape
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    origin = np.array([width, height]) / 2
    half_s, half_r = (float(np.abs(way) @ [width, height]) / 2 for way in (along, across))
    s = np.arange(-half_s, half_s)
    rows = np.linspace(-half_r, half_r, count)
    places = origin + s[None, :, None] * along + rows[:, None, None] * across
    profiles = sample(picture, places)
    window = max(15, len(s) // 8)
    filled = np.nan_to_num(profiles, nan=0.0)
    filled = uniform_filter1d(filled, 3, axis=1)
    low = minimum_filter1d(filled, window, axis=1)
    high = maximum_filter1d(filled, window, axis=1)
    least, most, part = _CONTRAST
    dark = (filled < (low + high) / 2) | (high - low < np.clip(part * high, least, most))
    fits = [_fit(mask, s) for mask in dark]
    scores = np.array([0.0 if fit is None else fit.score for fit in fits])
    if scores.max() < _FEWEST:
        return None
    good = scores >= max(_FEWEST, 0.6 * scores.max())
    # The longest run of good lines that agree with the best one, with small gaps.
    middle = int(np.argmax(uniform_filter1d(scores * good, 5)))
    if fits[middle] is None or not good[middle]:
        middle = int(np.argmax(scores))
    reference = fits[middle]
    assert reference is not None
    members = [middle]
    for step in (1, -1):
        row, missed, last = middle + step, 0, reference
        while 0 <= row < len(fits) and missed < 3:
            fit = fits[row]
            moved = None if fit is None or not good[row] else fit.like(last)
            if moved is None:
                missed += 1
            else:
                missed, last = 0, moved
                fits[row] = moved
                members.append(row)
            row += step
    chosen = sorted(members)
    if len(chosen) < 3:
        return None
    kept = [fit for row in chosen if (fit := fits[row]) is not None]
    r = rows[chosen]
    start = line_through(r, np.array([fit.start for fit in kept]))
    wide = line_through(r, np.array([fit.width for fit in kept]))
    numbers, times = np.unique(np.concatenate([fit.blacks for fit in kept]), return_counts=True)
    return Lines(
        origin,
        along,
        across,
        start,
        wide,
        (float(r[0]), float(r[-1])),
        numbers[times >= 0.3 * len(kept)],
        float(sum(fit.score for fit in kept)),
    )


def line_through(r: NDArray[np.float64], value: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) Value at r = 0 and slope of a robust line, by the Theil-Sen estimator.

    It is the median of the slopes of all pairs of points (Theil 1950, Sen 1968).

    Args:
        r: (N,) positions.
        value: (N,) values at these positions.
    """
    first, second = np.triu_indices(len(r), 1)
    slope = np.median((value[second] - value[first]) / (r[second] - r[first]))
    return np.array([np.median(value - slope * r), slope])


@dataclass(frozen=True, eq=False)
class _Fit:
    """A line across the keyboard, on which u = (s - start) / width."""

    start: float
    width: float
    blacks: NDArray[np.int64]
    score: float

    def like(self, other: _Fit) -> _Fit | None:
        """The same fit with the octaves counted as in another one; None if they disagree."""
        if abs(self.width / other.width - 1) > 0.03:
            return None
        middle = other.start + other.width * float(black_place(other.blacks).mean())
        shift = (middle - self.start) / self.width - (middle - other.start) / other.width
        octaves = round(shift / 7)
        if abs(shift - 7 * octaves) > 0.4:
            return None
        return _Fit(
            self.start + 7 * octaves * self.width,
            self.width,
            self.blacks - 5 * octaves,
            self.score,
        )


def _fit(dark: NDArray[np.bool_], s: NDArray[np.float64]) -> _Fit | None:
    """Explain the dark segments of a line as black keys.

    Args:
        dark: (S,) bool, dark pixels.
        s: (S,) their coordinates along the line [pixels].
    """
    edges = np.flatnonzero(np.diff(dark, prepend=False, append=False))
    begin, end = edges[::2], edges[1::2]
    centre = s[0] + (begin + end - 1) / 2
    length = (end - begin).astype(np.float64)
    if len(centre) < _FEWEST:
        return None
    # Lines between white keys are dark too, but thin.
    broad = length > 0.35 * np.percentile(length, 75)
    centre, length = centre[broad], length[broad]
    if len(centre) < _FEWEST:
        return None
    # Two segments that are five black keys, and so an octave, apart determine width and start, for
    # each of the five black keys that they may be. Where some between them are hidden, they are
    # fewer apart.
    guesses = []
    for step in (5, 4, 3):
        if len(centre) <= step:
            continue
        left = np.repeat(np.arange(len(centre) - step), 5)
        kind = np.tile(np.arange(5), len(centre) - step)
        width = (centre[left + step] - centre[left]) / 7
        guesses.append((centre[left] - width * _BLACK_AT[kind], width, length[left] / width))
    start, width, ratio = (np.concatenate(each) for each in zip(*guesses, strict=True))
    sensible = (ratio > _WIDTHS[0]) & (ratio < _WIDTHS[1]) & (width > _NARROWEST)
    if not sensible.any():
        return None
    start, width = start[sensible], width[sensible]
    score, number, fits = _judge(centre, length, start, width)
    best: _Fit | None = None
    for guess in np.argsort(-score)[:_GUESSES]:
        refined = _least_squares(centre, length, number[guess], fits[guess])
        if refined is not None and (best is None or refined.score > best.score):
            best = refined
    return best


def _least_squares(
    centre: NDArray[np.float64],
    length: NDArray[np.float64],
    number: NDArray[np.int64],
    fits: NDArray[np.bool_],
) -> _Fit | None:
    """Refine a fit by least squares, each time with the segments that fit then."""
    best: _Fit | None = None
    for _ in range(3):
        if fits.sum() < _FEWEST:
            break
        width, start = np.polyfit(black_place(number[fits]), centre[fits], 1)
        if not width > _NARROWEST:
            break
        score, numbers, fitting = _judge(centre, length, np.array([start]), np.array([width]))
        number, fits = numbers[0], fitting[0]
        if fits.sum() >= _FEWEST and (best is None or score[0] > best.score):
            best = _Fit(float(start), float(width), np.unique(number[fits]), float(score[0]))
    return best


def _judge(
    centre: NDArray[np.float64],
    length: NDArray[np.float64],
    start: NDArray[np.float64],
    width: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """Compare H hypotheses about start and width with the N dark segments of a line.

    Args:
        centre: (N,) centres of the segments [pixels].
        length: (N,) their lengths [pixels].
        start: (H,) [pixels].
        width: (H,) [pixels].

    Returns:
        (H,) scores, (H, N) index of the black key nearest to each segment, and (H, N) bool,
        whether the segment fits it.
    """
    u = (centre[None] - start[:, None]) / width[:, None]
    octave = np.floor(u / 7)
    off = np.abs((u - 7 * octave)[..., None] - _BLACK_AT)
    which = off.argmin(axis=2)
    number = (5 * octave + which).astype(np.int64)
    ratio = length[None] / width[:, None]
    proper = (ratio > _WIDTHS[0]) & (ratio < _WIDTHS[1])
    fits = (off.min(axis=2) < _OFF) & proper
    count = fits.sum(axis=1)
    lowest = np.where(fits, number, np.iinfo(np.int64).max).min(axis=1)
    highest = np.where(fits, number, np.iinfo(np.int64).min).max(axis=1)
    expected = np.where(count > 0, highest - lowest + 1, 0)
    stray = (proper & ~fits).sum(axis=1)
    score = count - 0.7 * np.abs(expected - count) - 0.7 * stray
    return score, number, fits
