"""Which finger played each note: decided over the whole piece from where the fingers were."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.music import Score
from pianomime.video.notes.touch import misfit

_FINGERS = 10
"""0..4 left thumb to little finger, 5..9 right."""
_BEAM = 60
"""Partial fingerings that are kept."""
_WORST = 20.0
"""Misfit beyond which a finger is simply elsewhere."""
_NOBODY = 25.0
"""The same of a hand that was never seen: a little better than a hand that is seen elsewhere."""
_STRIKE = 3
"""Frames from the onset in which a finger must be on its key."""
_HOLD = 0.3
"""How much the rest of a note counts, compared with its onset."""
_BUSY = 1.5
"""Cost of lifting a finger off a note to play another one; the same again for every frame that
the first note is cut short by, up to `_WORST`."""
_BUSY_FRAME = 0.3
_CROSSED = 1.0
"""Cost for fingers of one hand that do not lie in order along the keyboard."""
_THUMB_UNDER = 0.3
"""The same where the thumb is one of them."""
_ELSEWHERE = 9.0
"""Misfit of a note beyond which its finger was guessed rather than seen: two keys away."""


@dataclass(frozen=True, eq=False)
class NoteFingers:
    """Who plays the N notes of a score.

    Attributes:
        hand: (N,) int8; 0 left, 1 right.
        finger: (N,) int8; 0 thumb .. 4 little.
        stop: (N,) first frame in which the finger has let go.
        misfit: (N,) how badly the finger was seen to fit its key (`touch.misfit`).
    """

    hand: NDArray[np.int8]
    finger: NDArray[np.int8]
    stop: NDArray[np.int64]
    misfit: NDArray[np.float64]

    @property
    def guessed(self) -> NDArray[np.bool_]:
        """(N,) notes whose finger was not seen on or beside the key."""
        return self.misfit > _ELSEWHERE


def find_note_fingers(
    score: Score, points: NDArray[np.floating], seen: NDArray[np.bool_]
) -> NoteFingers:
    """The cheapest fingering: fingers near their keys, each on one key at a time, in order.

    A hand that was never seen gets, as a guess, those notes that no finger is anywhere near.

    Args:
        score: its times are those of the video.
        points: (T, 2, 6, 2 or 3) world x, y and perhaps z [m]; T reaches to the end of the score.
        seen: (2,) hands that were seen.
    """
    frames = score.note_frames()
    order = np.lexsort((score.key, frames[:, 0]))
    fit = _fits(score, points, frames)
    fit[:, np.repeat(~seen, 5)] = _NOBODY
    cost = np.zeros(1)
    until = np.zeros((1, _FINGERS), np.int64)
    since = np.full((1, _FINGERS), -1)
    on_key = np.full((1, _FINGERS), -1)
    # For each note and row of the beam the row and the finger before: in hours, bytes count.
    parents, picks = np.zeros((2, len(score), _BEAM), np.uint8)
    finger = np.arange(_FINGERS)
    hand = finger // 5
    # Fingers that should lie toward the treble, and toward the bass, of each finger.
    outward = np.where(hand == 0, 4 - finger, finger - 5)
    same = hand[:, None] == hand[None]
    above = same & (outward[None] > outward[:, None])
    below = same & (outward[None] < outward[:, None])
    thumbs = finger % 5 == 0
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
        # No finger strikes two keys at once.
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
        (picked // 5).astype(np.int8),
        (picked % 5).astype(np.int8),
        stop,
        fit[np.arange(len(score)), picked],
    )


def _fits(
    score: Score, points: NDArray[np.floating], frames: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(N, 10) how badly each finger fits each note, at its onset and for as long as it lasts."""
    fit = np.empty((len(score), _FINGERS))
    for note, (first, end) in enumerate(frames.tolist()):
        # A key that is struck again at the very end sounds only after the last frame.
        first = min(first, len(points) - 1)
        during = points[first : max(end, first + 1), :, 1:]
        off = np.minimum(misfit(during, score.key[note]), _WORST).reshape(-1, _FINGERS)
        fit[note] = off[:_STRIKE].mean(axis=0) + _HOLD * off.mean(axis=0)
    return fit


def _let_go(
    picked: NDArray[np.int64], frames: NDArray[np.int64], order: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(N,) where notes are cut short because their finger strikes another key."""
    stop = frames[:, 1].copy()
    holds = np.full(_FINGERS, -1)
    for note in order:
        before = holds[picked[note]]
        if before >= 0:
            stop[before] = max(min(stop[before], frames[note, 0]), frames[before, 0])
        holds[picked[note]] = note
    return stop
