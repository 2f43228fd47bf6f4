"""Notes read from the video itself: from keys that light up, or change their shade when pressed."""

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
"""`touching` from which a finger is on a key."""
_SHARES = (0.5, 0.8)
"""Shares of the neighbours' glow to subtract that are tried."""
_LEVELS = (0.2, 0.35, 0.5)
"""Levels of glow from which a key is taken to be down that are tried."""
_SHORTEST = 2
"""Frames of the shortest note."""
_FALSE = 2.0
"""Cost of a note that no finger plays, relative to the value of one that a finger plays."""
_DOUBT = 1.4
"""Factor by which notes read from keys that go down must be more than those from keys that light
up to be preferred."""
_VELOCITY = 80
"""Velocity of all notes; it cannot be read."""


class ReadNotes(NamedTuple):
    """Notes read from a video.

    Attributes:
        score: the notes, without pedal.
        touched: share of the notes with a finger on their key.
        lit: True if their keys light up; False if they only go down, and many are missed.
    """

    score: Score
    touched: float
    lit: bool


def read_notes(light: LightRecord, tracks: HandTracks, title: str) -> ReadNotes:
    """Read the notes that agree best with the fingers.

    All combinations of a patch of the keys, a measure of its change and a threshold are tried. The
    one with the most notes under a finger, less those that no finger can have played, is used.

    Args:
        light: colours of the keys in each frame, see `KeyLight`.
        tracks: the tracked hands.
        title: title of the score.
    """
    points, away = tracks.seen_points(), unattended(tracks)
    near = np.empty((KEYS, len(points)), bool)
    for key in range(KEYS):
        near[key] = touching(points, key) > _TOUCHED
    best: tuple[float, NDArray[np.int64], bool] = (0.0, np.zeros((0, 3), np.int64), True)
    for zone, colourful, share in product(range(len(ZONES)), (True, False), _SHARES):
        glow = Glow(light, away, zone, colourful)
        for notes in _runs(glow, share):
            value = _value(notes, near)
            if zone not in LIT:
                # Hands and their shadows change the look of a key as much as pressing it does.
                notes = notes[_touched(notes, near)]
                value /= _DOUBT
            if value > best[0]:
                best = value, notes, zone in LIT
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
    """Notes whose glow rises above a level, until it falls below half of that level.

    Args:
        glow: change of each key.
        share: share of the neighbours' glow to subtract.

    Returns:
        For each of `_LEVELS`, (N, 3) key, first frame, and frame after the last one.
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
                # The note begins where the key is bright, not where its glow starts to rise.
                bright = first + int(np.argmax(value[first:end] > level))
                notes.append((key, bright, end))
            arrays.append(np.array(notes, np.int64).reshape(-1, 3))
    return [np.concatenate(arrays) for arrays in found]


def _touched(notes: NDArray[np.int64], near: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N,) bool: notes with a finger on their key about the onset.

    Args:
        notes: (N, 3) as `_runs` returns them.
        near: (88, T) bool, whether a finger is on each key.
    """
    key, first = notes[:, 0], notes[:, 1]
    around = [np.clip(first + step, 0, near.shape[1] - 1) for step in (-1, 0, 1, 2)]
    return np.asarray(np.any([near[key, frame] for frame in around], axis=0))


def _value(notes: NDArray[np.int64], near: NDArray[np.bool_]) -> float:
    """Number of notes under a finger, less the cost of the others and of spilt light."""
    touched = _touched(notes, near)
    # Light that spills over to a neighbour looks like a second note beside the first one. Keys
    # are further apart than the video is long, so that a frame more or less is the same key.
    beside = near.shape[1] + 2
    at = notes[:, 0] * beside + notes[:, 1]
    spilt = sum(int(np.isin(at + beside + late, at).sum()) for late in (-1, 0, 1))
    return float(touched.sum() - _FALSE * (~touched).sum() - _FALSE * spilt)
