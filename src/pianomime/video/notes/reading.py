"""Notes read off the video itself: from the keys that light up, or look different when pressed."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, KEYS
from pianomime.music import Score
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.notes.key_light import LIT, ZONES, Glow, unattended
from pianomime.video.notes.touch import touching

_TOUCHED = np.exp(-1.0)
_SHARES = (0.5, 0.8)
_LEVELS = (0.2, 0.35, 0.5)
_SHORTEST = 2
"""Frames."""
_FALSE = 2.0
"""How much worse a note that no finger plays is than a note that one does is good."""
_DOUBT = 1.4
"""How many times as many notes keys must seem to play by going down as by lighting up, for the
first to be believed."""
_VELOCITY = 80


class ReadNotes(NamedTuple):
    """Notes, and how they were found.

    Attributes:
        score: the notes, without pedal.
        touched: share of them that a finger is on.
        lit: their keys light up; otherwise they only go down, and many are missed.
    """

    score: Score
    touched: float
    lit: bool


def read_notes(light: LightRecord, tracks: HandTracks, title: str) -> ReadNotes:
    """Find the notes that agree best with the fingers.

    The places where a note may show, and how strong a sign is asked for, are those that give the
    most notes under a finger and the fewest that no finger can have played.

    Args:
        light: of each frame, see `KeyLight`.
        tracks: the hands.
        title: of the score.
    """
    points, away = tracks.seen_points(), unattended(tracks)
    near = np.empty((KEYS, len(points)), bool)
    for key in range(KEYS):
        near[key] = touching(points, key) > _TOUCHED
    best: tuple[float, NDArray[np.int64], bool] = (0.0, np.zeros((0, 3), np.int64), True)
    for zone, colourful, share in product(range(len(ZONES)), (True, False), _SHARES):
        glow = Glow(light, away, zone, colourful)
        for notes in _runs(glow, share):
            worth = _worth(notes, near)
            if zone not in LIT:
                # Hands and their shadows change a key as much as going down does.
                notes = notes[_touched(notes, near)]
                worth /= _DOUBT
            if worth > best[0]:
                best = worth, notes, zone in LIT
    notes = best[1]
    touched = _touched(notes, near)
    score = Score(
        key=notes[:, 0],
        onset=notes[:, 1] / FRAME_RATE,
        offset=notes[:, 2] / FRAME_RATE,
        velocity=np.full(len(notes), _VELOCITY),
        title=title,
    )
    return ReadNotes(score, float(touched.mean()) if len(notes) else 0.0, best[2])


def _runs(glow: Glow, share: float) -> list[NDArray[np.int64]]:
    """For each of `_LEVELS` (N, 3) key, first frame and end of what rises above it.

    A note lasts until it is down to half the level.
    """
    found: list[list[NDArray[np.int64]]] = [[] for _ in _LEVELS]
    for key in range(KEYS):
        value = glow.standing_out(key, share)
        for level, arrays in zip(_LEVELS, found, strict=True):
            notes = []
            lit = np.concatenate(([False], value > level / 2, [False]))
            edges = np.flatnonzero(np.diff(lit.astype(np.int8)))
            for first, end in edges.reshape(-1, 2).tolist():
                if end - first < _SHORTEST or value[first:end].max() <= level:
                    continue
                # It begins when it is bright, not when the glow of what comes begins.
                bright = first + int(np.argmax(value[first:end] > level))
                notes.append((key, bright, end))
            arrays.append(np.array(notes, np.int64).reshape(-1, 3))
    return [np.concatenate(arrays) for arrays in found]


def _touched(notes: NDArray[np.int64], near: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N,) whether a finger is on the key, of (88, T), within a frame of the onset."""
    key, first = notes[:, 0], notes[:, 1]
    around = [np.clip(first + step, 0, near.shape[1] - 1) for step in (-1, 0, 1, 2)]
    return np.asarray(np.any([near[key, frame] for frame in around], axis=0))


def _worth(notes: NDArray[np.int64], near: NDArray[np.bool_]) -> float:
    touched = _touched(notes, near)
    # Glow that spills over looks like a note beside a note at the same time.
    beside = near.shape[1] + 2  # wider than the video: a frame late or early is on the same key
    at = notes[:, 0] * beside + notes[:, 1]
    spilt = sum(int(np.isin(at + beside + late, at).sum()) for late in (-1, 0, 1))
    return float(touched.sum() - _FALSE * (~touched).sum() - _FALSE * spilt)
