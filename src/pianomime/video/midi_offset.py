"""When in the video a MIDI file begins: where fingers, and lit keys, are where the notes are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from pianomime.music import KEYS, Score
from pianomime.video.hand_tracks import HandTracks
from pianomime.video.key_light import ZONES, glow, standing_out
from pianomime.video.stretches import RATE
from pianomime.video.touch import touching

_MATCH = 0.7
"""Share of notes with a finger on their key from which a MIDI file is taken to be the right one."""
_INSIDE = 0.5
"""Share of the music, or of the video if that is shorter, that must fall together."""


@dataclass(frozen=True)
class Offset:
    """How a MIDI file lies on a video.

    Attributes:
        seconds: a note struck at t in the file is struck at t + seconds in the video.
        touched: share of the notes within the video that have a finger on their key.
        by_chance: the same for the middling offset: how it would be for any song.
    """

    seconds: float
    touched: float
    by_chance: float

    @property
    def matches(self) -> bool:
        """Whether the file seems to be what is played."""
        return self.touched >= _MATCH and self.touched >= self.by_chance + 0.15


def estimate_offset(
    score: Score, tracks: HandTracks, light: NDArray[np.uint8], given: float | None = None
) -> Offset:
    """Find the offset at which the score fits the video best.

    Args:
        score: of the MIDI file.
        tracks: the hands.
        light: (T, zones, 88, 3), see `KeyLight`.
        given: the offset, if it is known: then only how well it fits is found out.
    """
    near = touching(tracks.points)
    touched, counts, lags = _correlate(near > np.exp(-1.0), score)
    evidence, _, _ = _correlate(near, score)
    best_light, best_peak = np.zeros(len(lags)), 0.0
    for zone in range(len(ZONES)):
        for colourful in (True, False):
            shine = np.clip(standing_out(glow(light, zone, colourful)), 0, 1)
            # What comes on at a note, and was not on just before.
            rise = np.maximum(shine[1:] - shine[:-1], 0)
            rise = np.pad(rise, ((1, 0), (0, 0)))
            found, _, _ = _correlate(rise, score)
            peak = float(found.max() - np.median(found))
            if peak > best_peak:
                best_light, best_peak = found, peak
    total = evidence + best_light
    length = score.onset.max() * RATE - score.onset.min() * RATE
    first = lags + score.onset.min() * RATE
    together = np.minimum(first + length, len(near)) - np.maximum(first, 0)
    possible = (together >= _INSIDE * min(length, len(near))) & (counts > 0)
    # Music repeats itself: that many notes fit says more than that a few fit very well.
    sure = (total - np.median(total[possible])) * np.sqrt(counts)
    at = int(np.argmax(np.where(possible, sure, -np.inf)))
    if given is None:
        seconds = (lags[at] + _vertex(total, at)) / RATE
    else:
        seconds = given
        at = int(np.clip(round(given * RATE) - lags[0], 0, len(lags) - 1))
    return Offset(float(seconds), float(touched[at]), float(np.median(touched[possible])))


def _correlate(
    value: NDArray[np.float32] | NDArray[np.bool_], score: Score
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Mean of value (T, 88) at the onsets of all notes within the video, for every lag.

    Returns:
        The means (L,), how many notes fall within the video (L,), and the lags (L,) [frames].
    """
    onset = np.floor(score.onset * RATE + 0.5).astype(np.int64)
    length = int(onset.max(initial=0)) + 1
    total = np.zeros(len(value) + length - 1)
    for key in range(KEYS):
        struck = onset[score.key == key]
        if len(struck):
            train = np.bincount(struck, minlength=length).astype(np.float64)
            total += fftconvolve(value[:, key].astype(np.float64), train[::-1])
    counts = np.rint(fftconvolve(np.ones(len(value)), np.bincount(onset, minlength=length)[::-1]))
    lags = np.arange(-(length - 1), len(value))
    return total / np.maximum(counts, 1), counts, lags


def _vertex(value: NDArray[np.float64], at: int) -> float:
    if not 0 < at < len(value) - 1:
        return 0.0
    before, here, after = value[at - 1 : at + 2]
    curve = before - 2 * here + after
    return float(0.5 * (before - after) / curve) if curve < 0 else 0.0
