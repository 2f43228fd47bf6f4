"""The keyboard's track: its plane in every frame of a film, whether the camera moves or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.short_repr import short_repr
from pianomime.video.keyboard.plane import Plane


@dataclass(frozen=True, eq=False)
class KeyboardTrack:
    """Where the keyboard is in the frames of a film.

    Attributes:
        planes: the planes in which it is seen.
        frames: (T,) int64 number of the plane of each frame, -1 where no keyboard is seen; the last
            holds for all that follow.
        backgrounds: pictures without hands (height, width, 3) uint8, with the plane of the keyboard
            in each, that show what keys look like when they are seen first; none of a camera that
            does not move, where the frames themselves do.
    """

    planes: tuple[Plane, ...]
    frames: NDArray[np.int64]
    backgrounds: tuple[tuple[NDArray[np.uint8], Plane], ...] = ()

    __repr__ = short_repr

    @staticmethod
    def still(plane: Plane) -> KeyboardTrack:
        """The track of a camera that does not move."""
        return KeyboardTrack((plane,), np.zeros(1, np.int64))

    def at(self, frame: int) -> Plane | None:
        """The plane in a frame, 0, 1, ...; None where no keyboard is seen."""
        which = int(self.frames[min(frame, len(self.frames) - 1)])
        return None if which < 0 else self.planes[which]

    @property
    def usual(self) -> Plane:
        """The plane of the frame in the middle of those in which the keyboard is seen."""
        seen = self.frames[self.frames >= 0]
        return self.planes[int(seen[len(seen) // 2])]

    def missing(self, frames: int) -> NDArray[np.bool_]:
        """(frames,) bool, in which of the first so many frames no keyboard is seen."""
        return np.asarray(self.frames[np.minimum(np.arange(frames), len(self.frames) - 1)] < 0)
