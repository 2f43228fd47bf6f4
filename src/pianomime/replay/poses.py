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

_BLOCK_SECONDS = 10

UNIT = 1e-4
"""[rad, m] Positions are stored as whole numbers of it."""
_LARGEST = np.iinfo(np.int16).max * UNIT


def move_block(first: int, positions: NDArray[np.float64]) -> bytes:
    """A block of poses.

    Args:
        first: number of the first pose.
        positions: (N, q) positions of all joints [rad, m]; farther than 3.27 from 0 they are cut.
    """
    return _packed(first, _whole(positions))


class Poses:
    """Takes down the joint positions of a performance while its motion is looked at.

    Args:
        performance: any performance.
    """

    def __init__(self, performance: Performance) -> None:
        self._kept, self._same = performance.qpos, True
        # Of an hour they take 100 MB like this, and four times as much as they come.
        self._found = [np.zeros((1, performance.qpos.shape[1]), np.int16)]

    def of(self, frames: Iterable[FrameMotion]) -> Iterator[FrameMotion]:
        """Pass on the motion of every frame, and take down its poses.

        Args:
            frames: of `pianomime.players.motion.motion`.
        """
        for frame, kept in zip(frames, self._kept, strict=True):
            found = np.hstack([frame.keys, frame.position])[POSE_SUBSTEPS::POSE_SUBSTEPS]
            # Where the physics broke, what came before the recovery may be no number.
            self._found.append(_whole(np.where(np.isfinite(found), found, kept)))
            self._same &= frame.same
            yield frame

    @property
    def rate(self) -> int:
        """Poses per second.

        They are fewer, those that the performance has kept, where not every frame was looked at, or
        playing the controls again gave another motion, as on a machine that rounds otherwise.
        """
        return POSES_PER_SECOND if self._complete else round(FRAME_RATE)

    def __len__(self) -> int:
        """Number of poses."""
        return sum(map(len, self._found)) if self._complete else 1 + len(self._kept)

    def at(self, seconds: float) -> NDArray[np.float64]:
        """(142,) The positions of all joints at a time, between two poses on a straight line.

        Args:
            seconds: from the beginning [s]; after the last pose, that counts.
        """
        place = min(seconds * self.rate, len(self) - 1)
        before, part = int(place), place % 1
        first, second = (self._pose(at) for at in (before, min(before + 1, len(self) - 1)))
        between: NDArray[np.float64] = first + part * (second - first)
        return between

    def blocks(self) -> Iterator[bytes]:
        """Blocks of all poses, as `move_block` makes them, one after the other."""
        parts = self._found if self._complete else [self._found[0], _whole(self._kept)]
        first, gathered = 0, list[NDArray[np.int16]]()
        for part in parts:
            gathered.append(part)
            if sum(map(len, gathered)) >= _BLOCK_SECONDS * self.rate:
                yield _packed(first, np.vstack(gathered))
                first += sum(map(len, gathered))
                gathered.clear()
        if gathered:
            yield _packed(first, np.vstack(gathered))

    @property
    def _complete(self) -> bool:
        """Whether all frames were looked at, and moved as they have before."""
        return self._same and len(self._found) == 1 + len(self._kept)

    def _pose(self, number: int) -> NDArray[np.float64]:
        pose: NDArray[np.float64]
        if not number:
            pose = self._found[0][0] * UNIT
        elif self._complete:
            frame, place = divmod(number - 1, len(self._found[-1]))
            pose = self._found[1 + frame][place] * UNIT
        else:
            pose = self._kept[number - 1]
        return pose


def _whole(positions: NDArray[np.float64]) -> NDArray[np.int16]:
    return np.rint(np.clip(positions, -_LARGEST, _LARGEST) / UNIT).astype(np.int16)


def _packed(first: int, whole: NDArray[np.int16]) -> bytes:
    # Differences compress to a fraction; they wrap around, and so does their sum.
    changes = np.diff(whole, axis=0, prepend=np.zeros((1, whole.shape[1]), np.int16))
    head = struct.pack("<II", first, len(whole))
    return block("MOVE", head + np.ascontiguousarray(changes.T, "<i2").tobytes())
