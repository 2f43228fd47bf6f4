"""Alignment of fingertips with the keys they press: from tracked hands to a FingertipPlan."""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, NO_KEY
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.plan.fingertip_plan import HOVER_HEIGHT
from pianomime.video.keyboard.geometry import BLACK_FRONT, FAR, FRONT, WHITE_WIDTH
from pianomime.video.notes.fingers import NoteFingers
from pianomime.world.parameters import key_centres, key_half_sizes

Rule = Literal["steady", "paper"]
"""How fingertips are aligned with keys, see `align`."""

_LEAD = 8
"""Frames over which a finger moves from where it was tracked to where it presses, and back."""
_WHITE_X = (-0.020, 0.072)
"""[m] Range of world x in which fingertips press white keys; further back, keys need more force."""
_BLACK_X = (-0.055, 0.008)
"""[m] Range of world x in which fingertips press black keys."""


def raised(points: NDArray[np.floating], frames: int) -> NDArray[np.float64]:
    """Points at `HOVER_HEIGHT`, pressing nothing, for a number of frames.

    Args:
        points: (T, 2, 6, 2) tracked points, world x, y [m].
        frames: number of frames; if there are more than T, the last points are repeated.

    Returns:
        (frames, 2, 6, 3) world frame [m].
    """
    high = np.full((frames, *points.shape[1:3], 3), HOVER_HEIGHT)
    high[: len(points), ..., :2] = points[:frames]
    high[len(points) :, ..., :2] = points[-1]
    return high


def align(
    score: Score, fingertips: NDArray[np.float64], fingers: NoteFingers, rule: Rule = "steady"
) -> FingertipPlan:
    """Move fingertips that press onto the middle lines of their keys, at z = 0.

    Args:
        score: the notes, in the time of the fingertips.
        fingertips: (T, 2, 6, 3) points as `raised` returns them, a row for each frame of the
            score. To save memory they are changed in place, and become those of the plan.
        fingers: the finger that plays each note; the paper's rule does not use it.
        rule: "steady" keeps a finger in one place for as long as it presses, and moves it there
            and back smoothly; "paper" is step 3 of the paper's appendix A, frame by frame.
    """
    if rule == "paper":
        return _as_in_the_paper(score, fingertips)
    finger_key = np.full((len(fingertips), 2, 5), NO_KEY, np.int8)
    for note, (first, _) in enumerate(score.note_frames()):
        finger_key[first : fingers.stop[note], fingers.hand[note], fingers.finger[note]] = (
            score.key[note]
        )
    for hand in range(2):
        for finger in range(5):
            keys, tip = finger_key[:, hand, finger], fingertips[:, hand, finger + 1]
            tip[:, :2] += _shift(tip[:, :2], keys)
            tip[keys != NO_KEY, 2] = 0.0
    return FingertipPlan(fingertips, finger_key, fingers.hand, fingers.finger)


def _shift(tip: NDArray[np.float64], keys: NDArray[np.int8]) -> NDArray[np.float64]:
    """(T, 2) Displacement of one fingertip (T, 2) that puts it on its keys (T,) [m]."""
    frames = len(tip)
    # One more row, of zeros, serves as the press before the first and after the last.
    shift = np.zeros((frames + 1, 2))
    begins, ends = [], [0]
    edges = np.flatnonzero(np.diff(keys, prepend=NO_KEY, append=NO_KEY)).tolist()
    for first, end in pairwise(edges):
        key = int(keys[first])
        if key == NO_KEY:
            continue
        low, high = _BLACK_X if BLACK[key] else _WHITE_X
        place = [np.clip(np.median(tip[first:end, 0]), low, high), key_centres()[key, 1]]
        # The finger comes down vertically: in the frame before, it already is over its key.
        first -= first > 0 and keys[first - 1] == NO_KEY
        shift[first:end] = place - tip[first:end]
        begins.append(first)
        ends.append(end)
    # Between presses, displacements fade out and in.
    for gone, coming in zip(ends, [*begins, frames], strict=True):
        frame = np.arange(gone, coming)[:, None]
        behind = np.clip(1 - (frame - gone + 1) / _LEAD, 0, 1) * (gone > 0)
        ahead = np.clip(1 - (coming - frame) / _LEAD, 0, 1) * (coming < frames)
        mixed = ahead * shift[coming] + behind * shift[gone - 1]
        shift[gone:coming] = mixed / np.maximum(ahead + behind, 1.0)
    return shift[:-1]


def _as_in_the_paper(score: Score, fingertips: NDArray[np.float64]) -> FingertipPlan:
    """Steps 3 and 4 of the paper's appendix A, frame by frame.

    Of the free fingers on a key that should be down, or else over the keys beside it, the nearest
    one is moved to the key's middle line; if there is none, the key is not pressed.
    """
    centres, half = key_centres(), key_half_sizes()
    finger_key = np.full((len(fingertips), 2, 5), NO_KEY, np.int8)
    roll = score.roll()
    for frame, key in zip(*np.nonzero(roll), strict=True):
        tips = fingertips[frame, :, 1:]
        free = finger_key[frame] == NO_KEY
        beside = np.abs(tips[..., 1] - centres[key, 1])
        front = BLACK_FRONT if BLACK[key] else FRONT
        along = (tips[..., 0] > FAR) & (tips[..., 0] < front)
        on_it = (beside <= half[key, 1]) & along & free
        near = (beside <= 1.5 * WHITE_WIDTH) & free
        wanted = on_it if on_it.any() else near
        if not wanted.any():
            continue
        hand, finger = np.unravel_index(np.argmin(np.where(wanted, beside, np.inf)), beside.shape)
        finger_key[frame, hand, finger] = key
        fingertips[frame, hand, finger + 1, 1:] = centres[key, 1], 0.0
    note_hand = np.full(len(score), -1, np.int8)
    note_finger = note_hand.copy()
    for note, (first, end) in enumerate(score.note_frames()):
        often = (finger_key[first:end] == score.key[note]).sum(axis=0)
        if often.any():
            note_hand[note], note_finger[note] = np.unravel_index(often.argmax(), often.shape)
    return FingertipPlan(fingertips, finger_key, note_hand, note_finger)
