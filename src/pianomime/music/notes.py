"""Notes from a piano roll."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.keyboard import FRAME_SECONDS, KEYS
from pianomime.music.score import ScoreError


def notes_from_roll(
    roll: ArrayLike, dt: float = FRAME_SECONDS
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Read the notes of a roll: each run of frames in which a key is down is one note.

    Args:
        roll: (T, 88) bool, such as the keys pressed in a performance.
        dt: length of a frame [s].

    Returns:
        key (N,) int64, onset (N,) and offset (N,) float64 [s], sorted by (onset, key).

    Raises:
        ScoreError: the roll has another shape.
    """
    down = np.asarray(roll, bool)
    if down.ndim != 2 or down.shape[1] != KEYS:
        raise ScoreError(f"a roll must be (T, {KEYS}), not {down.shape}")
    silent = np.zeros((KEYS, 1), bool)
    edges = np.diff(np.hstack((silent, down.T, silent)).astype(np.int8), axis=1)
    key, first = np.nonzero(edges == 1)
    _, stop = np.nonzero(edges == -1)
    order = np.lexsort((key, first))
    # Multiplying these times by the frame rate gives exactly the same frames again (at 20 Hz);
    # with first * dt it does not.
    rate = 1.0 / dt
    return key[order], first[order] / rate, stop[order] / rate
