"""Fingertips as they would be seen from right above.

A landmark lies on the finger, a centimetre or two above the key's top, so a camera over the middle
sees it too far out, the farther from the middle the more. How much is measured on the notes: a
finger that plays a key is over it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.music import Score
from pianomime.video.notes.fingers import NoteFingers
from pianomime.world.parameters import key_centres

_FEWEST = 20
"""Notes."""
_SHORTEST = 0.2
"""[m] of keyboard that they must span."""
_MOST_SHIFT = 0.008
_MOST_STRETCH = 0.05


def take_back_parallax(points: NDArray[np.float64], score: Score, fingers: NoteFingers) -> float:
    """Take back a shift and a stretch along the keyboard, where the notes tell them.

    Args:
        points: (T, 2, 6, 2 or 3) world x, y and perhaps z [m]; changed in place.
        score: its times are those of the points.
        fingers: who seems to have played each note.

    Returns:
        By how many millimetres the fingers that play were moved, in the middle of all cases.
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
        # From the middle of the slopes between all pairs that are well apart (Theil and Sen).
        draw = np.random.default_rng(0)
        one, two = draw.integers(0, len(sure), (2, 4000))
        apart = np.abs(seen[one] - seen[two]) > _SHORTEST / 2
        if apart.any():
            slopes = (off[one] - off[two])[apart] / (seen[one] - seen[two])[apart]
            stretch = float(np.clip(np.median(slopes), -_MOST_STRETCH, _MOST_STRETCH))
    shift = float(np.clip(np.median(off - stretch * seen), -_MOST_SHIFT, _MOST_SHIFT))
    points[..., 1] *= 1 - stretch
    points[..., 1] -= shift
    return float(np.median(np.abs(shift + stretch * seen))) * 1000
