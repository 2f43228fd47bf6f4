"""Stretches of time in which something holds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing

from pianomime.keyboard import FRAME_RATE

_SHORTEST = 0.5
"""[s]"""


def stretches(holds: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """From and to [s] of stretches of frames (T,) of half a second or more; holes of one do."""
    closed = binary_closing(np.pad(holds, 2), np.ones(3))[2:-2]
    edges = np.flatnonzero(np.diff(closed.astype(np.int8), prepend=0, append=0))
    return [
        (float(first / FRAME_RATE), float(end / FRAME_RATE))
        for first, end in edges.reshape(-1, 2)
        if end - first >= _SHORTEST * FRAME_RATE
    ]
