"""Poses: the joint positions of a performance, 100 times a second, in small numbers."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE
from pianomime.players.motion import FrameMotion
from pianomime.players.performance import Performance
from pianomime.replay.blocks import block
from pianomime.world.parameters import PHYSICS_DT

POSE_SUBSTEPS = 2
"""Physics steps from one pose to the next. A key goes down within a few of them, which in slow
motion is to be seen."""
POSES_PER_SECOND = round(1 / (POSE_SUBSTEPS * PHYSICS_DT))

UNIT = 1e-4
"""[rad, m] Positions are stored as whole numbers of it."""
_LARGEST = np.iinfo(np.int16).max * UNIT


def move_block(first: int, positions: NDArray[np.float64]) -> bytes:
    """A block of poses.

    Args:
        first: number of the first pose.
        positions: (N, q) positions of all joints [rad, m]; farther than 3.27 from 0 they are cut.
    """
    whole = np.rint(np.clip(positions, -_LARGEST, _LARGEST) / UNIT).astype("<i2")
    # Differences compress to a fraction; they wrap around, and so does their sum.
    changes = np.diff(whole, axis=0, prepend=np.zeros((1, whole.shape[1]), "<i2"))
    head = struct.pack("<II", first, len(whole))
    return block("MOVE", head + np.ascontiguousarray(changes.T, "<i2").tobytes())


class Poses:
    """Takes down the joint positions of a performance while its motion is looked at.

    Args:
        performance: any performance.
    """

    def __init__(self, performance: Performance) -> None:
        rest = np.zeros((1, performance.qpos.shape[1]))
        self._kept, self._found, self._same = performance.qpos, [rest], True

    def of(self, frames: Iterable[FrameMotion]) -> Iterator[FrameMotion]:
        """Pass on the motion of every frame, and take down its poses.

        Args:
            frames: of `pianomime.players.motion.motion`.
        """
        for frame, kept in zip(frames, self._kept, strict=True):
            found = np.hstack([frame.keys, frame.position])[POSE_SUBSTEPS::POSE_SUBSTEPS]
            # Where the physics broke, what came before the recovery may be no number.
            self._found.append(np.where(np.isfinite(found), found, kept))
            self._same &= frame.same
            yield frame

    @property
    def rate(self) -> int:
        """Poses per second."""
        return POSES_PER_SECOND if self._whole else round(FRAME_RATE)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 142) The positions of all joints, the first at 0 s [rad, m].

        Where not every frame was looked at, or playing the controls again gave another motion, as
        on a machine that rounds otherwise, they are those that the performance has kept, of which
        there are fewer.
        """
        return np.vstack(self._found if self._whole else [self._found[0], self._kept])

    @property
    def _whole(self) -> bool:
        """Whether all frames were looked at, and moved as they have before."""
        return self._same and len(self._found) == 1 + len(self._kept)
