"""Constants of the keyboard and of time: keys, pitches, names, and the frame rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

KEYS = 88
"""Number of keys; key 0 is A0, key 87 is C8."""

KEYS_PER_OCTAVE = 12
"""Black and white keys of an octave."""

LOWEST_PITCH = 21
"""MIDI pitch of key 0."""

FRAME_RATE = 20.0
"""Frames a second: one frame is one control step (paper, section 4)."""

FRAME_SECONDS = 1.0 / FRAME_RATE
"""[s] Length of a frame."""

EXCERPT_SECONDS = 30.0
"""[s] Default length of an excerpt: the longest clip of the paper's protocol."""

LEAD_IN_SECONDS = 0.5
"""[s] Default silence before the first sound of what `pianomime play` plays: our choice, for the
paper's protocol has none. RoboPianist's tasks call it `initial_buffer_time`, 0 by default."""

NO_KEY = -1
"""Marks the absence of a key in arrays of keys."""

_NAMES = ("A", "A♯", "B", "C", "C♯", "D", "D♯", "E", "F", "F♯", "G", "G♯")

BLACK: NDArray[np.bool_] = np.array(
    [len(_NAMES[key % KEYS_PER_OCTAVE]) == 2 for key in range(KEYS)]
)
"""(88,) bool: the black keys; read-only."""
BLACK.setflags(write=False)


def key_name(key: int) -> str:
    """The name of a key with its octave, such as "C♯4"; key 39 is "C4".

    Args:
        key: 0..87.
    """
    octave = (key + LOWEST_PITCH) // KEYS_PER_OCTAVE - 1
    return f"{_NAMES[key % KEYS_PER_OCTAVE]}{octave}"
