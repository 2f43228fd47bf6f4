"""Correction of parallax along the keyboard.

A landmark lies on the finger, a centimetre or two above the top of the key. A camera over the
middle of the keyboard sees it too far outward, the more so the further out it is. The shift and
the stretch that this causes are estimated from the notes, since a finger that plays a key is over
it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.music import Score
from pianomime.video.notes.fingers import NoteFingers
from pianomime.world.parameters import key_centres

_FEWEST = 20
"""Least number of notes for an estimate."""
_SHORTEST = 0.2
"""[m] Least part of the keyboard that the notes must span for an estimate of the stretch."""
_MOST_SHIFT = 0.008
"""[m] Largest shift that is corrected."""
_MOST_STRETCH = 0.05
"""Largest stretch that is corrected."""
_PAIRS = 4000
"""Pairs of notes whose slopes the stretch is estimated from."""


def correct_parallax(points: NDArray[np.float64], score: Score, fingers: NoteFingers) -> float:
    """Estimate shift and stretch along the keyboard from the notes, and remove them.

    Args:
        points: (T, 2, 6, 2) or (T, 2, 6, 3) world x, y and z [m]; changed in place.
        score: the notes, in the time of the points.
        fingers: the finger that probably played each note.

    Returns:
        Median displacement of the fingers that play [mm]; 0 with too few notes.
    """
    sure = np.flatnonzero(~fingers.guessed)
    if len(sure) < _FEWEST:
        return 0.0
    frame = np.minimum(score.note_frames()[sure, 0] + 1, len(points) - 1)
    seen = points[frame, fingers.hand[sure], fingers.finger[sure] + 1, 1]
    off = seen - key_centres()[score.key[sure], 1]
    low, high = np.percentile(seen, [5, 95])
    stretch = 0.0
    if high - low >= _SHORTEST:
        # The Theil-Sen estimator (Theil 1950, Sen 1968): the median of the slopes between pairs,
        # here of random pairs that are well apart.
        rng = np.random.default_rng(0)
        one, two = rng.integers(0, len(sure), (2, _PAIRS))
        apart = np.abs(seen[one] - seen[two]) > _SHORTEST / 2
        if apart.any():
            slopes = (off[one] - off[two])[apart] / (seen[one] - seen[two])[apart]
            stretch = float(np.clip(np.median(slopes), -_MOST_STRETCH, _MOST_STRETCH))
    shift = float(np.clip(np.median(off - stretch * seen), -_MOST_SHIFT, _MOST_SHIFT))
    points[..., 1] *= 1 - stretch
    points[..., 1] -= shift
    return float(np.median(np.abs(shift + stretch * seen))) * 1000
