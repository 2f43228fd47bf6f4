"""Agreement of notes with fingers, beyond chance.

Five fingers cover five keys, so that many notes have a finger on their key by chance, also in a
wrong result. What counts is by how much more than that agree: (observed - chance) / (1 - chance),
the chance-corrected agreement of Cohen (1960). Chance is what the same notes get at other times, as
those of another song would, or on other keys, as on a keyboard that is named wrongly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, KEYS
from pianomime.music import Score
from pianomime.short_repr import short_repr
from pianomime.video.notes.touch import touching

_TOUCHED = np.exp(-1.0)
"""`touching` from which a finger is on a key."""
_AROUND = (-1, 0, 1, 2)
"""Frames about the onset in one of which a finger must be on the key."""
_LAGS = 200
"""Other times at which the notes are tried for chance."""
_LEAST_LAG = 1.0
"""[s] Fingers are over their keys for a while before and after; closer times are no others."""
_OCTAVE = 12
"""Semitones by which the notes are shifted at most for chance: further off, fewer fingers are."""
_LIKELY_LAG = 5.0
"""[s] Most by which a time that fits better is looked for."""
_BETTER = 0.1
"""Share of notes by which another time or key must fit better to be told."""
_FITS = 0.7
"""Share of notes with a finger on their key from which another time or key is worth telling."""
_MOST_CHANCE = 0.9
"""Chance is not taken for more: where fingers lie on all keys of a piece, few misses decide."""
PRIOR = 2.0
"""Notes that agree as by chance are added, so that a few notes alone prove little."""


@dataclass(frozen=True)
class Shift:
    """A shift of all notes.

    Attributes:
        keys: semitones up.
        seconds: later [s].
        touched: share of the notes with a finger on their key, if they are shifted so.
        now: the same share, if they are not.
    """

    keys: int
    seconds: float
    touched: float
    now: float


@dataclass(frozen=True, eq=False)
class Agreement:
    """How well the N notes of a score agree with the fingers in a video.

    Attributes:
        touched: (N,) bool, notes with a finger on their key about the onset.
        shown: (N,) bool, notes whose onset is in a frame with a keyboard; others prove nothing.
        chance: share of notes that would have a finger on their key by chance, 0..1.
    """

    touched: NDArray[np.bool_]
    shown: NDArray[np.bool_]
    chance: float

    __repr__ = short_repr

    @property
    def share(self) -> float:
        """Share of the notes that are shown with a finger on their key, 0..1."""
        return float(self.touched[self.shown].mean()) if self.shown.any() else 0.0

    @property
    def beyond_chance(self) -> float:
        """Agreement beyond chance: 1 if all notes agree, 0 (or less) if no more than by chance."""
        touched = self.touched[self.shown]
        share = (touched.sum() + PRIOR * self.chance) / (len(touched) + PRIOR)
        return float(beyond(share, self.chance))


def beyond(share: float | NDArray[np.float64], chance: float) -> float | NDArray[np.float64]:
    """Agreement beyond chance of a share of notes.

    Args:
        share: of the notes that agree, 0..1.
        chance: share that would agree by chance, less than 1.
    """
    return (share - chance) / (1 - chance)


def agreement(score: Score, points: NDArray[np.floating], missing: NDArray[np.bool_]) -> Agreement:
    """Compare the notes of a score with the fingers of a video.

    Args:
        score: the notes, in the time of the video.
        points: (T, H, 6, 2) world x, y of the hands [m], infinite where a hand was not seen.
        missing: (T,) bool, frames that show no keyboard.
    """
    touched = _Touched(score, points, missing)
    frames, least = len(points), round(_LEAST_LAG * FRAME_RATE)
    shares = [touched.share(keys=step) for step in range(-_OCTAVE, _OCTAVE + 1) if step]
    if frames > 2 * least:
        lags = np.unique(np.linspace(least, frames - least, _LAGS).astype(np.int64))
        shares.append(np.median([touched.share(lag=int(lag), around=True) for lag in lags]))
    chance = min(float(max(shares)), _MOST_CHANCE)
    return Agreement(touched(), touched.shown(), chance)


def better_shift(
    score: Score, points: NDArray[np.floating], missing: NDArray[np.bool_]
) -> Shift | None:
    """The shift with which clearly more notes have a finger on their key; None if there is none.

    Args:
        score: the notes, in the time of the video.
        points: (T, H, 6, 2) world x, y of the hands [m], infinite where a hand was not seen; as
            they were tracked, as a correction of parallax fits them to the notes without a shift.
        missing: (T,) bool, frames that show no keyboard.
    """
    touched = _Touched(score, points, missing)
    least, most = round(_LEAST_LAG * FRAME_RATE), round(_LIKELY_LAG * FRAME_RATE)
    now = touched.share()
    shifts = [(keys, 0) for keys in range(-2 * _OCTAVE, 2 * _OCTAVE + 1) if keys]
    shifts += [(0, lag) for lag in range(-most, most + 1) if abs(lag) >= least]
    tried = [Shift(keys, lag / FRAME_RATE, touched.share(keys, lag), now) for keys, lag in shifts]
    most_touched = max(shift.touched for shift in tried)
    best = [shift for shift in tried if shift.touched == most_touched]
    # Fingers are over their keys for a while, so that some times are as good: the middle one is it.
    return best[len(best) // 2] if most_touched >= max(now + _BETTER, _FITS) else None


def fingers_about(points: NDArray[np.floating]) -> NDArray[np.bool_]:
    """(88, T) Whether a finger is on each key in a frame or close to it.

    Args:
        points: (T, H, 6, 2) world x, y of the hands [m], infinite where a hand was not seen.
    """
    near = np.stack([touching(points, key) > _TOUCHED for key in range(KEYS)])
    frame = np.arange(len(points))
    about = np.zeros_like(near)
    for step in _AROUND:
        about |= near[:, np.clip(frame + step, 0, len(points) - 1)]
    return about


class _Touched:
    """Which notes have a finger on their key, also if all of them are shifted."""

    def __init__(
        self, score: Score, points: NDArray[np.floating], missing: NDArray[np.bool_]
    ) -> None:
        self._near = fingers_about(points)
        self._frames = len(points)
        self._missing = missing[: self._frames]
        self._key = score.key
        self._onset = np.minimum(score.note_frames()[:, 0], self._frames - 1)

    def __call__(self, keys: int = 0, lag: int = 0, around: bool = False) -> NDArray[np.bool_]:
        """(N,) bool, with all notes so many keys up and frames later.

        Args:
            keys: number of keys.
            lag: number of frames.
            around: notes past the end begin again at the beginning; else no finger is there.
        """
        key, frame = self._key + keys, self._at(lag, around)
        inside = (key >= 0) & (key < KEYS) & (frame >= 0) & (frame < self._frames)
        on_it = self._near[np.clip(key, 0, KEYS - 1), np.clip(frame, 0, self._frames - 1)]
        return np.asarray(on_it & inside)

    def shown(self, lag: int = 0, around: bool = False) -> NDArray[np.bool_]:
        """(N,) bool, notes that are not in a frame without a keyboard, shifted as above."""
        frame = self._at(lag, around)
        inside = (frame >= 0) & (frame < self._frames)
        return np.asarray(~(self._missing[np.clip(frame, 0, self._frames - 1)] & inside))

    def share(self, keys: int = 0, lag: int = 0, around: bool = False) -> float:
        """Share of the notes that are shown with a finger on their key, shifted as above."""
        shown = self.shown(lag, around)
        return float(self(keys, lag, around)[shown].mean()) if shown.any() else 0.0

    def _at(self, lag: int, around: bool) -> NDArray[np.int64]:
        """(N,) frame of each note."""
        frame = self._onset + lag
        return frame % self._frames if around else frame
