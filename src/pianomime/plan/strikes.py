"""Strikes: when each key is to sound and be let go, how loud, and which finger strikes it.

The frames of a plan say where the hands are. Its strikes say what is to be heard, at its own time.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, FRAME_SECONDS
from pianomime.music import Score
from pianomime.music.voices import INNER, voices
from pianomime.plan.fingering import Fingering
from pianomime.short_repr import short_repr

_EDGE = 0.005
"""[s] A key is struck no nearer than this to the ends of the frame in which it begins: frames are
looked at when they end, and nobody hears so little."""
_LINGER = 0.008
"""[s] From the end of the last frame that needs a key until it is let go: frames are looked at when
they end."""
_REPEAT = 0.07
"""[s] A key that sounds again is let go at least so long before: it must come back half of its way,
and the finger must be on it again."""
_SHORTEST = 0.03
"""[s] Least time from the onset of a strike until its key is let go."""


@dataclass(frozen=True, eq=False)
class Strikes:
    """M strikes, in the order of their onsets.

    Attributes:
        note: (M,) index of the note in the score.
        hand: (M,) 0 left, 1 right.
        finger: (M,) 0 thumb .. 4 little.
        key: (M,) key 0..87.
        onset: (M,) when the key is to sound [s from the first frame]; in order.
        release: (M,) when the finger begins to let it go [s].
        velocity: (M,) MIDI velocity of the note, 1 to 127.
        outer: (M,) bool: of the melody or the bass, which an ear follows.

    Raises:
        ValueError: the arrays differ in length, onsets are not in order, or a key is let go before
            it sounds.
    """

    note: NDArray[np.int64]
    hand: NDArray[np.int64]
    finger: NDArray[np.int64]
    key: NDArray[np.int64]
    onset: NDArray[np.float64]
    release: NDArray[np.float64]
    velocity: NDArray[np.int64]
    outer: NDArray[np.bool_]

    def __post_init__(self) -> None:
        if {getattr(self, field.name).shape for field in fields(self)} != {self.key.shape}:
            raise ValueError("strikes must have as many of everything")
        if (np.diff(self.onset) < 0).any():
            raise ValueError("strikes must be in the order of their onsets")
        if not (self.onset < self.release).all():
            raise ValueError("keys must be let go after they sound")

    __repr__ = short_repr

    def __len__(self) -> int:
        """Number of strikes."""
        return len(self.key)

    def some_since(self, which: NDArray[np.int64], since: float) -> Strikes:
        """Some of the strikes, timed from a later moment.

        Args:
            which: (n,) their indices, in order.
            since: that moment [s].
        """
        chosen = {field.name: getattr(self, field.name)[which] for field in fields(self)}
        return replace(
            Strikes(**chosen), onset=chosen["onset"] - since, release=chosen["release"] - since
        )


def strikes_of(score: Score, fingering: Fingering) -> Strikes:
    """The strikes of a score, in its own time rather than that of frames.

    A note is struck at its onset, but no nearer than 5 ms to the ends of the frame of the onset,
    and later by whole frames where the fingering has it so because the hand cannot arrive in time.
    Its key is let go when the last frame that needs it has ended, so that both frames and notes are
    right; earlier where finger or hand are needed elsewhere, or where it is to sound again.

    Args:
        score: the piece.
        fingering: of its notes; those that no finger plays, or in no frame, have no strike.
    """
    note = np.flatnonzero((fingering.hand >= 0) & (fingering.stop > fingering.start))
    key, frames = score.key[note].astype(np.int64), score.note_frames()[note]
    late = np.maximum(fingering.start[note] - frames[:, 0], 0)
    # A key that is struck again while it is down is down one frame later than it sounds.
    begins = np.floor(score.onset[note] * FRAME_RATE) * FRAME_SECONDS
    place = (score.onset[note] - begins).clip(_EDGE, FRAME_SECONDS - _EDGE)
    onset = begins + place + late * FRAME_SECONDS
    stop = fingering.stop[note] * FRAME_SECONDS
    # A hand that must be elsewhere leaves at once.
    cut = fingering.stop[note] < frames[:, 1]
    release = np.where(cut, stop, stop + _LINGER)

    by_key = np.lexsort((onset, key))
    again = key[by_key[1:]] == key[by_key[:-1]]
    following = np.full(len(note), np.inf)
    following[by_key[:-1][again]] = onset[by_key[1:][again]]
    release = np.maximum(np.minimum(release, following - _REPEAT), onset + _SHORTEST)
    order = np.argsort(onset, kind="stable")
    return Strikes(
        note=note[order],
        hand=fingering.hand[note][order].astype(np.int64),
        finger=fingering.finger[note][order].astype(np.int64),
        key=key[order],
        onset=onset[order],
        release=release[order],
        velocity=score.velocity[note][order].astype(np.int64),
        outer=(voices(score, FRAME_SECONDS)[note] != INNER)[order],
    )
