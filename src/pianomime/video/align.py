"""From tracked hands and the finger of every note to a FingertipPlan."""

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
"""How fingertips are put on their keys."""

_LEAD = 8
"""Frames over which a finger comes over to where it presses, and goes back."""
_WHITE_X = (-0.020, 0.072)
_BLACK_X = (-0.055, 0.008)
"""[m] world x between which a fingertip is on its key; behind, keys need too much force."""


def raised(points: NDArray[np.floating], frames: int) -> NDArray[np.float64]:
    """(frames, 2, 6, 3) points (T, 2, 6, 2) that press nothing: at `HOVER_HEIGHT`.

    Where there are too few the last ones are held, and where there are too many they are left out.
    """
    high = np.full((frames, *points.shape[1:3], 3), HOVER_HEIGHT)
    high[: len(points), ..., :2] = points[:frames]
    high[len(points) :, ..., :2] = points[-1]
    return high


def align(
    score: Score, fingertips: NDArray[np.float64], fingers: NoteFingers, rule: Rule = "steady"
) -> FingertipPlan:
    """Put the fingertips that press on the keys that they press.

    Args:
        score: its times are those of the fingertips.
        fingertips: (T, 2, 6, 3) `raised`, a row for each frame of the score. They are changed in
            place, and are those of the plan: two of them for hours would fill the memory.
        fingers: who plays each note. The paper's rule does without.
        rule: "steady": each finger stays where it pressed for as long as it does, in the middle of
            its key, and moves there and away smoothly. "paper": appendix A, step 3, frame by
            frame.
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
    """(T, 2) what to add to one fingertip so that it presses its keys (T,)."""
    frames = len(tip)
    # A row more, of nothing, for before the first key and after the last one.
    shift = np.zeros((frames + 1, 2))
    begins, ends = [], [0]
    edges = np.flatnonzero(np.diff(keys, prepend=NO_KEY, append=NO_KEY)).tolist()
    for first, end in pairwise(edges):
        key = int(keys[first])
        if key == NO_KEY:
            continue
        low, high = _BLACK_X if BLACK[key] else _WHITE_X
        place = [np.clip(np.median(tip[first:end, 0]), low, high), key_centres()[key, 1]]
        # It comes down from above its key: the frame before counts as one in which it presses.
        first -= first > 0 and keys[first - 1] == NO_KEY
        shift[first:end] = place - tip[first:end]
        begins.append(first)
        ends.append(end)
    # Before and after, less and less of it.
    for gone, coming in zip(ends, [*begins, frames], strict=True):
        frame = np.arange(gone, coming)[:, None]
        behind = np.clip(1 - (frame - gone + 1) / _LEAD, 0, 1) * (gone > 0)
        ahead = np.clip(1 - (coming - frame) / _LEAD, 0, 1) * (coming < frames)
        mixed = ahead * shift[coming] + behind * shift[gone - 1]
        shift[gone:coming] = mixed / np.maximum(ahead + behind, 1.0)
    return shift[:-1]


def _as_in_the_paper(score: Score, fingertips: NDArray[np.float64]) -> FingertipPlan:
    """Appendix A, steps 3 and 4, frame by frame.

    A finger on the key that is to be pressed, or else the nearest free one over the keys beside
    it, is moved to its middle line; if there is none, nothing is done.
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
