"""FingertipPlan: target of every fingertip, and the key it presses, frame by frame.

A planner makes it from a Score; a tracker turns it into controls.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, KEYS
from pianomime.short_repr import count, short_repr
from pianomime.world.layout import LAYOUT

if TYPE_CHECKING:
    from pianomime.plan.strikes import Strikes

LEFT, RIGHT = 0, 1
"""Index of a hand in every plan array: keyboard order, bass side first."""

POINTS = ("wrist", "thumb", "index", "middle", "ring", "little")
"""Points of a hand, in the order of every array of points."""
FINGERS = POINTS[1:]
"""Fingers of a hand, in the order of every array of fingers."""

HOVER_HEIGHT = 0.045
"""[m] z of points that press nothing: twice the height of a key (paper, appendix A, step 4)."""


@dataclass(frozen=True, eq=False)
class FingertipPlan:
    """Targets of both hands in each of T frames of 0.05 s, and who plays each of N notes.

    Attributes:
        fingertips: (T, 2, 6, 3) target positions [m], world frame; hands (left, right); points
            as in `POINTS`. Fingertips at z = 0 press their key all the way down (paper,
            appendix A, step 4); any other z is where the fingertip hovers.
        finger_key: (T, 2, 5) int8; key 0..87 that each finger presses, -1 (`NO_KEY`) for none.
        note_hand: (N,) int8; hand of each note of the score: 0 left, 1 right, -1 not played.
        note_finger: (N,) int8; finger of each note: 0 thumb .. 4 little, -1 not played.
        strikes: when keys are to sound and how loud, between frames; None for plans of frames
            alone, such as a human's. Files do not hold them.
        joints: (T, 2, 27) joint positions with which the robot's hands have their points there
            [rad, m]; None where they are not known, as for a human's plan. A tracker may begin
            from them. Files do not hold them.

    Raises:
        ValueError: shapes do not match, or `fingertips` or `joints` are not finite.
    """

    fingertips: NDArray[np.float64]
    finger_key: NDArray[np.int8]
    note_hand: NDArray[np.int8]
    note_finger: NDArray[np.int8]
    strikes: Strikes | None = None
    joints: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        frames = len(self.fingertips)
        if self.fingertips.shape != (frames, 2, 6, 3):
            raise ValueError(f"fingertips must be (T, 2, 6, 3), not {self.fingertips.shape}")
        if self.finger_key.shape != (frames, 2, 5):
            raise ValueError(f"finger_key must be ({frames}, 2, 5), not {self.finger_key.shape}")
        if self.joints is not None and self.joints.shape != (frames, 2, LAYOUT.hand_joints):
            wanted = (frames, 2, LAYOUT.hand_joints)
            raise ValueError(f"joints must be {wanted}, not {self.joints.shape}")
        if self.note_hand.shape != self.note_finger.shape:
            raise ValueError("note_hand and note_finger must both have one entry per note")
        for name in ("fingertips", "joints"):
            array = getattr(self, name)
            if array is not None and not np.isfinite(array).all():
                raise ValueError(f"{name} hold values that are not finite")

    def __repr__(self) -> str:
        notes = count(len(self.note_hand), "note")
        return short_repr(
            self, f"{len(self) / FRAME_RATE:.1f} s", f"{notes} ({self.dropped} dropped)"
        )

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.fingertips)

    @property
    def dropped(self) -> int:
        """Number of notes that no finger plays."""
        return int((self.note_hand < 0).sum())

    def keys(self) -> NDArray[np.bool_]:
        """(T, 88) bool: keys that a finger should press in each frame."""
        down = np.zeros((len(self), KEYS), bool)
        frame, hand, finger = np.nonzero(self.finger_key >= 0)
        down[frame, self.finger_key[frame, hand, finger]] = True
        return down
