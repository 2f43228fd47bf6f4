"""Fingering of a video: the finger that played each note, by a beam search over the whole piece.

The cost of a fingering is how far its fingers are from their keys, plus what makes it unlikely: a
finger on two notes at once, or fingers of one hand out of order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.music import Score
from pianomime.short_repr import short_repr
from pianomime.video.notes.touch import misfit
from pianomime.world.layout import FINGER_COUNT

_FINGERS = 2 * FINGER_COUNT
"""Fingers of both hands: 0..4 left thumb to little finger, 5..9 right."""
_BEAM = 60
"""Number of partial fingerings kept."""
_WORST = 20.0
"""Largest misfit of a finger; beyond it, the distance makes no difference."""
_NOBODY = 25.0
"""Misfit of the fingers of a hand that was never seen; at its worst, a seen finger has 1.3 times
`_WORST`, which is a little more."""
_STRIKE = 3
"""Frames from the onset on in which a finger must be on its key."""
_HOLD = 0.3
"""Weight of the misfit in all frames of a note, relative to that at its onset."""
_BUSY = 1.5
"""Cost of lifting a finger off a note to play another one."""
_BUSY_FRAME = 0.3
"""Cost of each frame by which that cuts the first note short; the sum is at most `_WORST`."""
_CROSSED = 1.0
"""Cost of two fingers of one hand out of order along the keyboard."""
_THUMB_UNDER = 0.3
"""Cost of two fingers out of order if one of them is the thumb."""
ELSEWHERE = 9.0
"""Misfit, that of a finger two keys away, beyond which the finger of a note is only a guess."""


@dataclass(frozen=True, eq=False)
class NoteFingers:
    """The fingers that play the N notes of a score.

    Attributes:
        hand: (N,) int8; 0 left, 1 right.
        finger: (N,) int8; 0 thumb .. 4 little.
        stop: (N,) first frame in which the finger no longer presses.
        misfit: (N,) misfit of the tracked finger and its key, see `touch.misfit`.
    """

    hand: NDArray[np.int8]
    finger: NDArray[np.int8]
    stop: NDArray[np.int64]
    misfit: NDArray[np.float64]

    __repr__ = short_repr

    @property
    def guessed(self) -> NDArray[np.bool_]:
        """(N,) bool: notes whose finger was not seen on or beside the key."""
        return self.misfit > ELSEWHERE


def find_note_fingers(
    score: Score, points: NDArray[np.floating], seen: NDArray[np.bool_]
) -> NoteFingers:
    """Find the cheapest fingering of a score, given tracked hands.

    A hand that was never seen gets, as a guess, the notes that no finger is near.

    Args:
        score: the notes, in the time of the video.
        points: (T, 2, 6, 2) or (T, 2, 6, 3) world x, y and z [m], to the end of the score.
        seen: (2,) bool, hands that were seen.
    """
    frames = score.note_frames()
    order = np.lexsort((score.key, frames[:, 0]))
    fit = _fits(score, points, frames)
    fit[:, np.repeat(~seen, FINGER_COUNT)] = _NOBODY
    cost = np.zeros(1)
    until = np.zeros((1, _FINGERS), np.int64)
    since = np.full((1, _FINGERS), -1)
    on_key = np.full((1, _FINGERS), -1)
    # For each note and row of the beam, the row before and the finger, as bytes to save memory.
    parents, picks = np.zeros((2, len(score), _BEAM), np.uint8)
    finger = np.arange(_FINGERS)
    hand = finger // FINGER_COUNT
    # Which fingers should be on the treble side, and which on the bass side, of each finger.
    outward = np.where(hand == 0, 4 - finger, finger - 5)
    same = hand[:, None] == hand[None]
    above = same & (outward[None] > outward[:, None])
    below = same & (outward[None] < outward[:, None])
    thumbs = finger % FINGER_COUNT == 0
    price = np.where(thumbs[:, None] | thumbs[None], _THUMB_UNDER, _CROSSED)
    for number, note in enumerate(order):
        first, end = frames[note]
        key = score.key[note]
        held = np.maximum(until - first, 0)
        step = fit[note] + np.where(held > 0, np.minimum(_BUSY + _BUSY_FRAME * held, _WORST), 0.0)
        busy = held > 0
        wrong_above = busy & (on_key < key)
        wrong_below = busy & (on_key > key)
        step = step + wrong_above @ (above * price).T + wrong_below @ (below * price).T
        # A finger cannot strike two keys at once.
        step = step + np.where(since == first, _WORST, 0.0)
        total = cost[:, None] + step
        keep = min(_BEAM, total.size)
        flat = np.argpartition(total.ravel(), keep - 1)[:keep]
        parent, pick = np.unravel_index(flat, total.shape)
        cost = total[parent, pick]
        until, since, on_key = (each[parent].copy() for each in (until, since, on_key))
        row = np.arange(keep)
        since[row, pick] = first
        until[row, pick] = np.maximum(end, first + 1)
        on_key[row, pick] = key
        parents[number, :keep], picks[number, :keep] = parent, pick
    picked = np.zeros(len(score), np.int64)
    row_now = int(np.argmin(cost))
    for number in reversed(range(len(order))):
        picked[order[number]] = picks[number, row_now]
        row_now = int(parents[number, row_now])
    stop = _let_go(picked, frames, order)
    return NoteFingers(
        (picked // FINGER_COUNT).astype(np.int8),
        (picked % FINGER_COUNT).astype(np.int8),
        stop,
        fit[np.arange(len(score)), picked],
    )


def _fits(
    score: Score, points: NDArray[np.floating], frames: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(N, 10) Misfit of each finger and each note, at its onset and while it lasts."""
    fit = np.empty((len(score), _FINGERS))
    for note, (first, end) in enumerate(frames.tolist()):
        # A key struck again at the very end is down only after the last frame.
        first = min(first, len(points) - 1)
        during = points[first : max(end, first + 1), :, 1:]
        off = np.minimum(misfit(during, score.key[note]), _WORST).reshape(-1, _FINGERS)
        fit[note] = off[:_STRIKE].mean(axis=0) + _HOLD * off.mean(axis=0)
    return fit


def _let_go(
    picked: NDArray[np.int64], frames: NDArray[np.int64], order: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(N,) Frame in which each note ends, at the latest when its finger strikes another key."""
    stop = frames[:, 1].copy()
    holds = np.full(_FINGERS, -1)
    for note in order:
        before = holds[picked[note]]
        if before >= 0:
            stop[before] = max(min(stop[before], frames[note, 0]), frames[before, 0])
        holds[picked[note]] = note
    return stop
