"""Notes read from the video itself: from keys that light up, or light above them."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, KEYS
from pianomime.music import Score
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.notes.key_light import ZONES, Glow, unattended
from pianomime.video.notes.lit import are_lit
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
"""Cost of a note that is no light or that no finger plays, relative to the value of another."""
_BRIDGED = 1.0
"""[s] Longest time without a keyboard in which a key that is lit before and after it stays lit."""
_FEWEST = 3
"""Least number of notes of a film whose keys light up."""
_VELOCITY = 80
"""Velocity of all notes; it cannot be read."""


class ReadNotes(NamedTuple):
    """Notes read from a video.

    Attributes:
        score: the notes, without pedal; none if keys do not light up.
        touched: share of the notes with a finger on their key; 1 if there are no hands.
        lit: whether keys light up in this film.
        confidence: how sure that is, 0..1: the share of what changes on the keys that is light, if
            keys light up; else one less the greatest such share.
    """

    score: Score
    touched: float
    lit: bool
    confidence: float


class _Found(NamedTuple):
    """What changes on the keys, seen in one way: in a zone, by a measure, above a level.

    Attributes:
        notes: (N, 3) as `_runs` returns them.
        lit: (N,) bool, those that are light.
        good: (N,) bool, those that are light and have a finger on their key.
        value: number of good notes, less the cost of the others.
    """

    notes: NDArray[np.int64]
    lit: NDArray[np.bool_]
    good: NDArray[np.bool_]
    value: float

    @property
    def share(self) -> float:
        """Share of the notes that are good."""
        return float(self.good.sum()) / max(len(self.notes), _FEWEST)


_NOTHING = _Found(np.zeros((0, 3), np.int64), np.zeros(0, bool), np.zeros(0, bool), 0.0)


def read_notes(
    light: LightRecord, tracks: HandTracks, missing: NDArray[np.bool_], title: str
) -> ReadNotes:
    """Read the notes that are most like light, and agree best with the fingers.

    All combinations of a patch of the keys, a measure of its change and a threshold are tried. The
    one with the most notes that are light and under a finger, less those that are not, is used. If
    in all of them most are not, keys do not light up.

    Args:
        light: colours of the keys in each frame, see `KeyLight`.
        tracks: the tracked hands; where there are none at all, notes need no finger.
        missing: (T,) bool, frames that show no keyboard: what is lit there is not known.
        title: title of the score.
    """
    points, away = tracks.seen_points(), unattended(tracks)
    near = np.ones((KEYS, len(points)), bool)
    hands = bool(tracks.seen.any())
    if hands:
        for key in range(KEYS):
            near[key] = touching(points, key) > _TOUCHED
    # Where no finger vouches for a note, its colour must.
    measures = (True, False) if hands else (True,)
    best, surest = _NOTHING, _NOTHING
    gaps = _intervals(missing)
    for zone, colourful, share in product(range(len(ZONES)), measures, _SHARES):
        glow = Glow(light, away, zone, colourful)
        runs = _runs(glow, share, gaps)
        for level, notes in enumerate(runs):
            lit = are_lit(light, zone, glow.usual, notes, points)
            good = lit & _touched(notes, near)
            value = _value(notes, good, len(points))
            if not hands:
                value -= _FALSE * _fickle(runs, level)
            found = _Found(notes, lit, good, value)
            if found.value > best.value and good.sum() >= _FEWEST:
                best = found
            if found.share > surest.share:
                surest = found
    lights = best is not _NOTHING
    notes = best.notes[best.lit]
    score = Score(
        key=notes[:, 0],
        onset=notes[:, 1] / FRAME_RATE,
        offset=notes[:, 2] / FRAME_RATE,
        velocity=np.full(len(notes), _VELOCITY),
        title=title,
    )
    touched = float(_touched(notes, near).mean()) if lights else 0.0
    return ReadNotes(score, touched, lights, best.share if lights else 1 - surest.share)


def _runs(glow: Glow, share: float, gaps: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Notes whose glow rises above a level, until it falls below half of that level.

    Args:
        glow: change of each key.
        share: share of the neighbours' glow to subtract.
        gaps: (G, 2) intervals that show no keyboard, as `_intervals` returns them.

    Returns:
        For each of `_LEVELS`, (N, 3) key, first frame, and frame after the last one.
    """
    found: list[list[NDArray[np.int64]]] = [[] for _ in _LEVELS]
    for key in range(KEYS):
        value = glow.standing_out(key, share)
        for level, arrays in zip(_LEVELS, found, strict=True):
            notes = []
            lit = value > level / 2
            for first, end in gaps.tolist():
                lit[first:end] = _stays_lit(lit, first, end)
            for first, end in _intervals(lit).tolist():
                if end - first < _SHORTEST or value[first:end].max() <= level:
                    continue
                # The note begins where the key is bright, not where its glow starts to rise.
                bright = first + int(np.argmax(value[first:end] > level))
                notes.append((key, bright, end))
            arrays.append(np.array(notes, np.int64).reshape(-1, 3))
    return [np.concatenate(arrays) for arrays in found]


def _intervals(holds: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(N, 2) First frame, and frame after the last one, of each interval in which (T,) holds."""
    return np.flatnonzero(np.diff(holds.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)


def _stays_lit(lit: NDArray[np.bool_], first: int, end: int) -> bool:
    """Whether a key that is lit (T,) is so also in an interval that does not show it: a short one.

    The light of a longer one may be that of another note.
    """
    if not 0 < first < end < len(lit) or end - first > _BRIDGED * FRAME_RATE:
        return False
    return bool(lit[first - 1] and lit[end])


def _touched(notes: NDArray[np.int64], near: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(N,) bool: notes with a finger on their key about the onset.

    Args:
        notes: (N, 3) as `_runs` returns them.
        near: (88, T) bool, whether a finger is on each key.
    """
    key, first = notes[:, 0], notes[:, 1]
    around = [np.clip(first + step, 0, near.shape[1] - 1) for step in (-1, 0, 1, 2)]
    return np.asarray(np.any([near[key, frame] for frame in around], axis=0))


def _value(notes: NDArray[np.int64], good: NDArray[np.bool_], frames: int) -> float:
    """Number of good notes, less the cost of the others and of spilt light.

    Args:
        notes: (N, 3) as `_runs` returns them.
        good: (N,) bool.
        frames: length of the video.
    """
    # Light that spills over to a neighbour looks like a second note beside the first one. Keys
    # are further apart than the video is long, so that a frame more or less is the same key.
    beside = frames + 2
    at = notes[:, 0] * beside + notes[:, 1]
    spilt = sum(int(np.isin(at + beside + late, at).sum()) for late in (-1, 0, 1))
    return float(good.sum() - _FALSE * (~good).sum() - _FALSE * spilt)


def _fickle(runs: list[NDArray[np.int64]], level: int) -> int:
    """Number of notes more or fewer at the level beside this one that is most like it.

    A light that is on or off is the same at every level; what spills over from others is not.
    """
    beside = [each for each in (level - 1, level + 1) if 0 <= each < len(runs)]
    return min(abs(len(runs[level]) - len(runs[each])) for each in beside)
