"""Voices: whether a note is heard as melody, as bass or between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.music.score import Score

MELODY, BASS, INNER = range(3)
"""Outer voices are what a listener follows; notes between them are missed least."""


def voices(score: Score, window: float) -> NDArray[np.int64]:
    """(N,) The voice of each note: `MELODY`, `BASS` or `INNER`.

    A note is the melody where no higher key sounds at its onset or is struck within `window` after
    it, else the bass where no lower one does, else an inner voice. So a note alone is the melody.

    Args:
        score: any score.
        window: within which notes are struck together [s].
    """
    ends = np.full(KEYS, -np.inf)
    voice = np.full(len(score), INNER)
    ahead = 0
    for note, (key, onset) in enumerate(zip(score.key.tolist(), score.onset.tolist(), strict=True)):
        while ahead < len(score) and score.onset[ahead] <= onset + window:
            ends[score.key[ahead]] = max(ends[score.key[ahead]], score.offset[ahead])
            ahead += 1
        sounding = ends > onset
        if not sounding[key + 1 :].any():
            voice[note] = MELODY
        elif not sounding[:key].any():
            voice[note] = BASS
    return voice
