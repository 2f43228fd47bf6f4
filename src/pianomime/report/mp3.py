"""MP3 sound for the report page: a tenth of the size of a WAV, and played by every browser."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import closing
from fractions import Fraction
from types import TracebackType
from typing import IO, Any, Self

import av
import numpy as np
from numpy.typing import NDArray

_BITS_PER_SECOND = 128_000
_LIVE_BITS_PER_SECOND = 320_000
"""A browser begins when it has 32 kB, which so are less than a second."""
_DELAY = 1105
"""Samples by which a decoder is late that is not told the encoder's delay."""


class Mp3:
    """A sound that is encoded as it comes. Use it as a context manager.

    Args:
        file: path, or an open file to which bytes are written as soon as they are encoded.
        sample_rate: samples per second [Hz].
    """

    def __init__(self, file: str | os.PathLike[str] | IO[bytes], sample_rate: int) -> None:
        live = hasattr(file, "write")
        self._file: Any = av.open(
            file if live else os.fspath(file),  # type: ignore[arg-type]
            "w",
            format="mp3",
            # A frame that tells the length can only be written when that is known.
            options={"flush_packets": "1", "write_xing": "0"} if live else {},
        )
        # At this rate, the encoder's fast search sounds like its thorough one.
        self._stream: Any = self._file.add_stream(
            "libmp3lame", rate=sample_rate, layout="stereo", options={"compression_level": "7"}
        )
        self._stream.bit_rate = _LIVE_BITS_PER_SECOND if live else _BITS_PER_SECOND
        self._rate, self._done = sample_rate, 0
        # So that what is heard is in time; at the beginning of music nothing sounds.
        self._left_out = _DELAY if live else 0

    def add(self, block: NDArray[np.float32]) -> None:
        """Encode what follows.

        Args:
            block: (s, 2) samples, -1..1.
        """
        left_out = min(self._left_out, len(block))
        self._left_out -= left_out
        block = block[left_out:]
        # Second by second, to keep copies of long blocks out of memory.
        for first in range(0, len(block), self._rate):
            samples = np.ascontiguousarray(block[first : first + self._rate].T, np.float32)
            frame = av.AudioFrame.from_ndarray(samples, format="fltp", layout="stereo")
            frame.sample_rate = self._rate
            frame.pts, frame.time_base = self._done + first, Fraction(1, self._rate)
            self._file.mux(self._stream.encode(frame))
        self._done += len(block)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with closing(self._file):
            if error is None:
                # What the encoder still holds.
                self._file.mux(self._stream.encode(None))


def write_mp3(
    path: str | os.PathLike[str], blocks: Iterable[NDArray[np.float32]], sample_rate: int
) -> None:
    """Encode sound as MP3, block by block.

    Args:
        path: the file.
        blocks: (s, 2) samples, -1..1, one block after the other.
        sample_rate: samples per second [Hz].
    """
    with Mp3(path, sample_rate) as file:
        for block in blocks:
            file.add(block)
