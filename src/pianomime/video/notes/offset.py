"""Offset of a MIDI file in a video, by correlation of its onsets with fingers and lit keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from pianomime.keyboard import FRAME_RATE, KEYS
from pianomime.music import Score
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.notes.key_light import LIT, Glow, unattended
from pianomime.video.notes.touch import touching

LATE_SOUND, LATEST_SOUND = 0.5, 3.0
"""[s] Most by which the sound of a video usually is before or after its pictures, and at all."""

_UNUSUAL = 0.8
"""Weight of the evidence for an unusual offset: music is much like itself some beats later."""

_TIE = 0.5
"""Notes by which the evidence for two offsets may differ by chance."""
_INSIDE = 0.5
"""Least overlap of music and video, as a share of the shorter one."""


@dataclass(frozen=True)
class Offset:
    """Where a MIDI file lies in a video, and how well it fits.

    Attributes:
        seconds: a note at time t of the file is at t + seconds in the video [s].
        touched: share of the notes with a finger on their key, of those at which a keyboard shows.
        by_chance: median of that share over all offsets, as it would be for another song.
    """

    seconds: float
    touched: float
    by_chance: float


def estimate_offset(
    score: Score,
    tracks: HandTracks,
    light: LightRecord,
    missing: NDArray[np.bool_],
    given: float | None = None,
    usual: float = np.inf,
    most: float = np.inf,
) -> Offset:
    """Find the offset at which the score fits the video best.

    Args:
        score: score of the MIDI file.
        tracks: the tracked hands.
        light: colours of the keys in each frame, see `KeyLight`.
        missing: (T,) bool, frames that show no keyboard: notes there prove nothing.
        given: the offset [s], if it is known; then only its fit is measured.
        usual: how far from 0 it usually is [s]; beyond that, the evidence must be clear.
        most: how far from 0 it may be [s].
    """
    points, away = tracks.seen_points(), unattended(tracks)
    onset = np.floor(score.onset * FRAME_RATE + 0.5).astype(np.int64)
    lags = np.arange(-int(onset.max()), len(points))
    # Number of notes that are shown, for every lag.
    counts = np.rint(fftconvolve((~missing).astype(np.float64), np.bincount(onset)[::-1]))

    def mean(
        value: Callable[[int], NDArray[np.float32] | NDArray[np.bool_]],
    ) -> NDArray[np.float64]:
        """Mean of a value (T,) of each key at the onsets of the notes, for every lag."""
        return np.asarray(_at_onsets(value, score.key, onset, len(lags)) / np.maximum(counts, 1))

    touched = mean(lambda key: touching(points, key) > np.exp(-1.0))
    evidence = mean(lambda key: touching(points, key))
    length = score.onset.max() * FRAME_RATE - score.onset.min() * FRAME_RATE
    first = lags + score.onset.min() * FRAME_RATE
    together = np.minimum(first + length, len(points)) - np.maximum(first, 0)
    possible = (together >= _INSIDE * min(length, len(points))) & (counts > 0)
    best_light, best_peak = np.zeros(len(lags)), 0.0
    for zone, colourful in product(LIT, (True, False)):
        rise = partial(_rise, Glow(light, away, zone, colourful))
        found = mean(rise)
        # Where few notes are in the video, one of them makes a peak.
        peak = float(found[possible].max(initial=0.0) - np.median(found))
        if peak > best_peak:
            best_light, best_peak = found, peak
    total = evidence + best_light
    # Music repeats itself, so a good fit of many notes is better evidence than one of few.
    sure = (total - np.median(total[possible])) * np.sqrt(counts)
    is_usual = np.abs(lags) <= usual * FRAME_RATE
    sure *= np.where(is_usual, 1.0, _UNUSUAL)
    open_lags = possible & (np.abs(lags) <= most * FRAME_RATE)
    # Where the music is hardly in the video, no offset is better than none.
    at = int(np.argmax(np.where(open_lags, sure, -np.inf)) if open_lags.any() else -lags[0])
    if given is None:
        as_good = open_lags & (is_usual == is_usual[at])
        as_good &= total >= total[at] - _TIE / max(counts[at], 1.0)
        seconds = (lags[0] + _middle(total, at, as_good)) / FRAME_RATE
    else:
        seconds = given
        at = int(np.clip(round(given * FRAME_RATE) - lags[0], 0, len(lags) - 1))
    return Offset(float(seconds), float(touched[at]), float(np.median(touched[possible])))


def _rise(glow: Glow, key: int) -> NDArray[np.float32]:
    """(T,) Increase of a key's glow in each frame, 0..1."""
    shine = np.clip(glow.standing_out(key), 0, 1)
    return np.maximum(np.diff(shine, prepend=shine[:1]), 0)


def _at_onsets(
    value: Callable[[int], NDArray[np.float32] | NDArray[np.bool_]],
    key: NDArray[np.int64],
    onset: NDArray[np.int64],
    lags: int,
) -> NDArray[np.float64]:
    """(L,) Sum of a value at the onsets of all notes, for every lag, by convolution.

    Args:
        value: returns the value (T,) of a key.
        key: (N,) key of each note.
        onset: (N,) onset of each note [frames].
        lags: number of lags, L.
    """
    total = np.zeros(lags)
    for each in range(KEYS):
        struck = onset[key == each]
        if len(struck):
            train = np.bincount(struck, minlength=onset.max() + 1).astype(np.float64)
            total += fftconvolve(value(each).astype(np.float64), train[::-1])
    return total


def _middle(value: NDArray[np.float64], at: int, as_good: NDArray[np.bool_]) -> float:
    """The place of a maximum: between samples, or in the middle of those that are as good.

    Where fingers rest on their keys long before and after they strike, many lags fit alike, and
    which is the best by a hair is chance.

    Args:
        value: (L,) samples.
        at: of the greatest.
        as_good: (L,) which are as good as that.
    """
    before, after = as_good[:at][::-1], as_good[at + 1 :]
    first = at - int(np.argmin(np.append(before, False)))
    last = at + int(np.argmin(np.append(after, False)))
    return at + _vertex(value, at) if first == last else (first + last) / 2


def _vertex(value: NDArray[np.float64], at: int) -> float:
    """Offset of the maximum of the parabola through three samples about `at`, in samples."""
    if not 0 < at < len(value) - 1:
        return 0.0
    before, here, after = value[at - 1 : at + 2]
    curve = before - 2 * here + after
    return float(0.5 * (before - after) / curve) if curve < 0 else 0.0
