"""Notes that are heard, checked against the hands that are seen."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, FRAME_SECONDS
from pianomime.music import Score
from pianomime.short_repr import short_repr
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.notes.fingers import ELSEWHERE
from pianomime.video.notes.touch import misfit

_AROUND = (-1, 0, 1, 2)
"""Frames about an onset in one of which a finger must be near the key."""
_HARMONICS = (12, 19, 24)
"""[semitones] From a string's tone to its second, third and fourth harmonic: the strongest ones,
which are heard as notes of their own now and then."""
_AT_ONCE = FRAME_SECONDS
"""[s] Greatest difference of the onsets of a note and of its harmonics."""


@dataclass(frozen=True, eq=False)
class Checked:
    """Notes that were heard, without those that no hand can have played.

    Attributes:
        score: the notes that are left.
        doubted: number of those that no finger is near, while both hands are seen.
        left_out: number of notes that were left out: doubted ones that are a harmonic of a louder
            note which begins at the same time and has a finger on it.
    """

    score: Score
    doubted: int
    left_out: int

    __repr__ = short_repr


def check_heard(score: Score, tracks: HandTracks) -> Checked:
    """Compare notes with the hands.

    Where a hand is not seen, it may play any note, and none is doubted.

    Args:
        score: the notes, in the time of the video.
        tracks: the tracked hands.
    """
    near, watched = _near(score, tracks)
    doubted = watched & ~near
    ghost = np.zeros(len(score), bool)
    for note in np.flatnonzero(doubted):
        first, stop = np.searchsorted(score.onset, score.onset[note] + [-_AT_ONCE, _AT_ONCE])
        with_it = slice(first, stop)
        ghost[note] = (
            near[with_it]
            & (score.velocity[with_it] > score.velocity[note])
            & np.isin(score.key[note] - score.key[with_it], _HARMONICS)
        ).any()
    kept = replace(
        score,
        key=score.key[~ghost],
        onset=score.onset[~ghost],
        offset=score.offset[~ghost],
        velocity=score.velocity[~ghost],
    )
    return Checked(kept, int((doubted & ~ghost).sum()), int(ghost.sum()))


def _near(score: Score, tracks: HandTracks) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(N,) Whether a fingertip is near the key of each note, and whether both hands are seen."""
    frame = np.floor(score.onset * FRAME_RATE).astype(np.int64)[:, None] + _AROUND
    frame = np.clip(frame, 0, len(tracks) - 1)
    tips = tracks.points[frame, :, 1:]
    off = misfit(tips, score.key[:, None, None, None]).min(axis=(1, 2, 3))
    return off <= ELSEWHERE, np.asarray(tracks.found[frame].all(axis=(1, 2)))
