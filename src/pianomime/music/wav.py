"""WAV files, written and read in blocks: the sound of an hour would take more than a gigabyte."""

from __future__ import annotations

import os
import wave
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from pianomime.closing import Closing
from pianomime.files import atomic
from pianomime.music.sound import SAMPLE_RATE

_FULL_SCALE = 32767
"""The sample that stands for 1."""


def write_wav(
    path: str | os.PathLike[str], audio: NDArray[np.floating], sample_rate: int = SAMPLE_RATE
) -> None:
    """Write a 16-bit WAV file.

    Args:
        path: the file; it is written in one step.
        audio: (S, C) samples of C channels; those beyond -1..1 are clipped.
        sample_rate: samples per second [Hz].

    Raises:
        ValueError: the audio has another shape.
    """
    if audio.ndim != 2:
        raise ValueError(f"audio must be (S, C), not {audio.shape}")
    seconds = (audio[at : at + sample_rate] for at in range(0, len(audio), sample_rate))
    write_wav_blocks(path, seconds, audio.shape[1], sample_rate)


def write_wav_blocks(
    path: str | os.PathLike[str],
    blocks: Iterable[NDArray[np.floating]],
    channels: int,
    sample_rate: int,
) -> None:
    """Write a 16-bit WAV file block by block, as `write_wav` does.

    Args:
        path: the file; it is written in one step.
        blocks: (S, C) samples, one after the other.
        channels: C.
        sample_rate: samples per second [Hz].
    """
    with atomic(path) as temporary, wave.open(str(temporary), "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(2)
        file.setframerate(sample_rate)
        for block in blocks:
            samples = np.clip(block, -1, 1) * _FULL_SCALE
            file.writeframes(np.rint(samples).astype("<i2").tobytes())


class WavFile(Closing):
    """The samples of a 16-bit WAV file, read when they are asked for. Use it as a context manager.

    Attributes:
        shape: (S, C) of all samples.
        sample_rate: samples per second [Hz].
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open a file that `write_wav` has written.

        Args:
            path: the file.

        Raises:
            OSError: it cannot be read.
        """
        self._file = wave.open(os.fspath(path), "rb")  # noqa: SIM115 - closed by `__exit__`
        self.shape = self._file.getnframes(), self._file.getnchannels()
        self.sample_rate = self._file.getframerate()

    def close(self) -> None:
        """Close it."""
        self._file.close()

    def __getitem__(self, samples: slice) -> NDArray[np.float32]:
        """(n, C) samples from a first to before a stop, -1..1; fewer at the end of the sound."""
        first, stop, _ = samples.indices(self.shape[0])
        self._file.setpos(first)
        content = np.frombuffer(self._file.readframes(max(stop - first, 0)), "<i2")
        return content.reshape(-1, self.shape[1]).astype(np.float32) / np.float32(_FULL_SCALE)

    def blocks(self, seconds: float) -> Iterator[NDArray[np.float32]]:
        """All samples in blocks of some seconds."""
        count = round(seconds * self.sample_rate)
        for first in range(0, self.shape[0], count):
            yield self[first : first + count]
