"""Confidence in a demonstration made from a video, frame by frame.

It is the product of three parts, each of which falls with what shows in a wrong result: hands that
are not seen, keys that are not where the keyboard's plane says, and notes that agree with the
fingers no better than by chance. What it cannot see is an octave by which notes read from the keys
and the fingers are off together; remarks on the names of the keys tell of that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter1d

from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score
from pianomime.short_repr import short_repr
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.keyboard_look import KeyboardLook
from pianomime.video.notes.agreement import PRIOR, Agreement, Shift, agreement, better_shift, beyond
from pianomime.video.notes.fingers import NoteFingers
from pianomime.video.notes.tempo import Tempo, better_tempo

DOUBT = 0.5
"""Confidence below which a frame is in doubt."""
_SHORT_GAP, _LONG_GAP = 0.1, 0.5
"""[s] Time to the nearest frame in which a hand was seen: up to the first, interpolation is as good
as seeing it; from the second on, where the hand is can only be guessed."""
_NO_KEYBOARD, _KEYBOARD = 0.65, 0.8
"""`KeyboardLook.pattern`: at most the first in our films if the plane is off by a fifth of a key or
by a whole number of keys; above the second where it was right."""
_HIDDEN, _USUAL = 0.5, 0.8
"""`KeyboardLook.usual`: below the first the keyboard is hidden or moved; above the second only
hands and lit keys differ from the usual look."""
_WINDOW = 1.0
"""[s] Standard deviation of the weights of notes about a frame."""


@dataclass(frozen=True, eq=False)
class Confidence:
    """Confidence in every frame, and what lowers it.

    Attributes:
        hands: (T, 2) how well each hand is seen, 0..1: less the longer it was not seen, and the
            more of its points were outliers; 0 for a hand that is not in the video.
        keyboard: (T,) whether the keys are where they should be, 0..1.
        notes: (T,) agreement beyond chance of the notes about the frame with the fingers, 0..1.
        in_video: (2,) bool, hands that are in the video.
        missing: (T,) bool, frames that show no keyboard, such as a title: there confidence is 0,
            and they count neither as good nor as doubtful.
        supported: (N,) bool, notes with a finger on their key at the onset that is also theirs.
        agreement: of all notes with the fingers.
        better: a shift of all notes with which they agree clearly better; None if there is none.
        tempo: a tempo with which they do so; None if there is none.
    """

    hands: NDArray[np.float32]
    keyboard: NDArray[np.float32]
    notes: NDArray[np.float32]
    in_video: NDArray[np.bool_]
    missing: NDArray[np.bool_]
    supported: NDArray[np.bool_]
    agreement: Agreement
    better: Shift | None
    tempo: Tempo | None

    __repr__ = short_repr

    @property
    def frames(self) -> NDArray[np.float32]:
        """(T,) confidence, 0..1: the product of keyboard, notes, and the mean over the hands."""
        hands = self.hands[:, self.in_video]
        seen = hands.mean(axis=1) if hands.shape[1] else np.zeros(len(hands), np.float32)
        return np.asarray(seen * self.keyboard * self.notes)

    @property
    def in_doubt(self) -> NDArray[np.bool_]:
        """(T,) bool, frames with a keyboard in which it is less than `DOUBT`."""
        return np.asarray((self.frames < DOUBT) & ~self.missing)

    @property
    def mean(self) -> float:
        """Mean confidence of the frames with a keyboard; 0 if there are none."""
        shown = self.frames[~self.missing]
        return float(shown.mean()) if len(shown) else 0.0

    def by_second(self) -> NDArray[np.float32]:
        """(ceil(T / 20),) Mean confidence of every second, 0 where no keyboard is shown."""
        frames = self.frames
        first = np.arange(0, len(frames), round(FRAME_RATE))
        count = np.diff(np.append(first, len(frames)))
        return np.asarray(np.add.reduceat(frames, first) / count, np.float32)


def estimate_confidence(
    tracks: HandTracks,
    score: Score,
    fingers: NoteFingers,
    points: NDArray[np.floating],
    look: KeyboardLook,
    missing: NDArray[np.bool_],
    notes_certainty: float = 1.0,
) -> Confidence:
    """Estimate how far a demonstration can be trusted in each frame.

    Args:
        tracks: the tracked hands.
        score: the notes, in the time of the video.
        fingers: the finger that plays each note.
        points: (F, 2, 6, 2) the points of the tracks without parallax, in the frames up to the end
            of the notes or of the video, whichever comes first.
        look: of the keyboard in the video.
        missing: (T,) bool, frames that show no keyboard.
        notes_certainty: how sure the notes are for another reason than the fingers, 0..1: that keys
            light up, where they were read from keys.
    """
    hands = _hands(tracks)
    # Where a hand is guessed, its fingers are evidence of nothing.
    reliable = (hands > DOUBT)[:, :, None, None]
    far = np.float32(np.inf)
    seen = np.where(reliable[: len(points)], points, far)[:, tracks.seen]
    agreed = agreement(score, seen, missing)
    raw = np.where(reliable, tracks.points, far)[:, tracks.seen]
    supported = agreed.touched & ~fingers.guessed
    notes = _notes(score, supported, agreed, missing) * notes_certainty
    keyboard = _ramp(look.usual, _HIDDEN, _USUAL) * ~missing
    if look.pattern is not None:
        keyboard = keyboard * _ramp(np.float64(look.pattern), _NO_KEYBOARD, _KEYBOARD)
    return Confidence(
        hands,
        np.asarray(keyboard, np.float32),
        np.asarray(notes, np.float32),
        tracks.seen,
        missing,
        supported,
        agreed,
        better_shift(score, raw[: len(points)], missing),
        better_tempo(score, raw),
    )


def _hands(tracks: HandTracks) -> NDArray[np.float32]:
    """(T, 2) How well each hand is seen."""
    seen = np.zeros((len(tracks), 2), np.float32)
    for hand in np.flatnonzero(tracks.seen):
        gap = distance_transform_edt(~tracks.found[:, hand]) / FRAME_RATE
        seen[:, hand] = (1 - _ramp(gap, _SHORT_GAP, _LONG_GAP)) * (
            1 - tracks.mended[:, hand].mean(axis=1)
        )
    return seen


def _notes(
    score: Score, supported: NDArray[np.bool_], agreed: Agreement, missing: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """(T,) Agreement beyond chance of the notes about each frame."""
    frames = len(missing)
    frame = np.minimum(score.note_frames()[:, 0], frames - 1)
    # Notes during a title say nothing about those before and after it.
    shown = ~missing[frame]
    frame, supported = frame[shown], supported[shown]
    sigma = _WINDOW * FRAME_RATE
    # The filter's weights have the sum 1; here a note in the frame itself weighs 1.
    scale = np.sqrt(2 * np.pi) * sigma
    count, good = (
        scale * gaussian_filter1d(np.bincount(frame, weights, frames), sigma, mode="constant")
        for weights in (np.ones(len(frame)), supported.astype(np.float64))
    )
    # Where there are no notes about, all notes of the video tell how far to trust it.
    everywhere = (supported.sum() + PRIOR * agreed.chance) / (len(frame) + PRIOR)
    share = (good + PRIOR * everywhere) / (count + PRIOR)
    return np.clip(beyond(share, agreed.chance), 0, 1)


def _ramp(value: NDArray[np.floating] | np.float64, zero: float, one: float) -> NDArray[np.float64]:
    """0 up to one value, 1 from another one on, and linear between them."""
    return np.clip((np.asarray(value, np.float64) - zero) / (one - zero), 0, 1)
