"""FingertipPlan: where every fingertip should be, and which key it presses, frame by frame.

It is what a planner hands to a tracker.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS

LEFT, RIGHT = 0, 1
"""Index of a hand in every plan array: keyboard order, bass side first."""

POINTS = ("wrist", "thumb", "index", "middle", "ring", "little")
FINGERS = POINTS[1:]


@dataclass(frozen=True, eq=False)
class FingertipPlan:
    """Targets of both hands at 20 Hz.

    Attributes:
        fingertips: (T, 2, 6, 3) [m] in the world frame; hands (left, right); points as in
            `POINTS`. A finger at z = 0 presses its key all the way down (paper, appendix A,
            step 4); any other z is where the fingertip should hover.
        finger_key: (T, 2, 5) int8; the key 0..87 that a finger presses in a frame, -1 for none.
        note_hand: (N,) int8; for each note of the score, 0 left, 1 right, -1 not played.
        note_finger: (N,) int8; for each note, 0 thumb .. 4 little, -1 not played.
    """

    fingertips: NDArray[np.float64]
    finger_key: NDArray[np.int8]
    note_hand: NDArray[np.int8]
    note_finger: NDArray[np.int8]

    def __post_init__(self) -> None:
        frames = len(self.fingertips)
        if self.fingertips.shape != (frames, 2, 6, 3):
            raise ValueError(f"fingertips must be (T, 2, 6, 3), not {self.fingertips.shape}")
        if self.finger_key.shape != (frames, 2, 5):
            raise ValueError(f"finger_key must be ({frames}, 2, 5), not {self.finger_key.shape}")
        if self.note_hand.shape != self.note_finger.shape:
            raise ValueError("note_hand and note_finger must have one entry a note each")
        if not np.isfinite(self.fingertips).all():
            raise ValueError("fingertips hold values that are not finite")

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.fingertips)

    @property
    def dropped(self) -> int:
        """Number of notes that no finger plays."""
        return int((self.note_hand < 0).sum())

    def keys(self) -> NDArray[np.bool_]:
        """(T, 88) bool: the keys that some finger is to press in each frame."""
        down = np.zeros((len(self), KEYS), bool)
        frame, hand, finger = np.nonzero(self.finger_key >= 0)
        down[frame, self.finger_key[frame, hand, finger]] = True
        return down
