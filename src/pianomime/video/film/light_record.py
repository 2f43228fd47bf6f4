"""Record of the colours of all keys over a whole video, on disk, because hours exceed memory."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pianomime.closing import Closing
from pianomime.keyboard import KEYS

_BLOCK = 2000
"""Frames of a block of the file, which is ordered by key: one read returns a key in all of them."""


class LightRecord(Closing):
    """Colours of Z patches of every key in T frames: written by frame, read by key.

    They are in an unnamed temporary file, which disappears when the record is closed.

    Raises:
        OSError: the disk of temporary files is full.
    """

    def __init__(self, zones: int) -> None:
        """Begin an empty record.

        Args:
            zones: number of patches of each key, Z.
        """
        self._file = tempfile.TemporaryFile(prefix="pianomime-")  # noqa: SIM115 - close() is ours
        self._block = np.empty((zones, KEYS, _BLOCK, 3), np.uint8)
        self._frames = 0

    @classmethod
    def of(cls, light: Iterable[NDArray[np.uint8]]) -> Self:
        """Make a record of frames.

        Args:
            light: at least one frame (Z, 88, 3) uint8.
        """
        frames = iter(light)
        first = next(frames)
        record = cls(len(first))
        record.append(first)
        for frame in frames:
            record.append(frame)
        return record

    def append(self, light: NDArray[np.uint8]) -> None:
        """Add a frame.

        Args:
            light: (Z, 88, 3) uint8, red, green and blue of each patch.
        """
        self._block[:, :, self._frames % _BLOCK] = light
        self._frames += 1
        if self._frames % _BLOCK == 0:
            self._file.seek(0, 2)
            self._file.write(self._block.data)

    def __len__(self) -> int:
        """Number of frames, T."""
        return self._frames

    def key(self, zone: int, key: int) -> NDArray[np.uint8]:
        """(T, 3) Colour of one patch of one key in every frame.

        Args:
            zone: the patch, 0 .. Z - 1.
            key: the key, 0..87.
        """
        light = np.empty((self._frames, 3), np.uint8)
        for first in range(0, self._frames, _BLOCK):
            light[first : first + _BLOCK] = self._read(first, zone, key, 1)[0]
        return light

    def blocks(self, zone: int) -> Iterator[NDArray[np.uint8]]:
        """(n, 88, 3) Colour of one patch of all keys, n = 2000 frames at a time.

        Args:
            zone: the patch, 0 .. Z - 1.
        """
        for first in range(0, self._frames, _BLOCK):
            yield self._read(first, zone, 0, KEYS).swapaxes(0, 1)

    def every(self, step: int, zone: int) -> NDArray[np.uint8]:
        """(ceil(T / step), 88, 3) Colour of one patch of all keys, every step-th frame.

        Args:
            step: number of frames from one to the next.
            zone: the patch, 0 .. Z - 1.
        """
        some = np.empty((-(-self._frames // step), KEYS, 3), np.uint8)
        first = 0
        for block in self.blocks(zone):
            picked = block[-first % step :: step]
            at = -(-first // step)
            some[at : at + len(picked)] = picked
            first += len(block)
        return some

    def close(self) -> None:
        """Delete the file."""
        self._file.close()

    def _read(self, first: int, zone: int, key: int, keys: int) -> NDArray[np.uint8]:
        """(keys, n, 3) Colours from the block that begins with frame `first`."""
        frames = min(_BLOCK, self._frames - first)
        if frames < _BLOCK:  # the last block is not in the file yet
            return self._block[zone, key : key + keys, :frames]
        zones = len(self._block)
        self._file.seek((first // _BLOCK * zones * KEYS + zone * KEYS + key) * _BLOCK * 3)
        read = self._file.read(keys * _BLOCK * 3)
        return np.frombuffer(read, np.uint8).reshape(keys, _BLOCK, 3)
