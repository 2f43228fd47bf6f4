"""Sound of an open file as samples without gaps, in constant memory."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from os import PathLike
from typing import Any, Literal

import av
import numpy as np
from numpy.typing import NDArray

_JITTER = 0.05
"""[s] Smaller gaps and overlaps in a file's times are those of rounding."""


def steady_sound(
    path: str | PathLike[str],
    container: Any,
    rate: int,
    layout: Literal["mono", "stereo"],
    start: float | None,
) -> Iterator[NDArray[np.float32]]:
    """Blocks of the first sound of a file, without gaps between them.

    Where the file has no sound for a while, there is silence. A damaged end is left out, with a
    warning.

    Args:
        path: the file, for the warning.
        container: as `open_media` yields it; it must have a stream of sound.
        rate: samples per second [Hz].
        layout: how many channels C are made of those that it has.
        start: time in the file at which the first block begins [s]; None for that of its first
            sound.

    Yields:
        (s, C) float32, about -1..1.
    """
    done, jitter = 0, round(_JITTER * rate)
    for seconds, block in _decoded(path, container, rate, layout):
        if start is None:
            start = seconds or 0.0
        begin = done if seconds is None else round((seconds - start) * rate)
        while begin - done > jitter:
            gap = min(begin - done, rate)
            yield np.zeros((gap, block.shape[1]), np.float32)
            done += gap
        if done - begin > jitter:
            block = block[done - begin :]
        yield block
        done += len(block)


def _decoded(
    path: str | PathLike[str], container: Any, rate: int, layout: str
) -> Iterator[tuple[float | None, NDArray[np.float32]]]:
    """Time in the file [s] and samples of each block."""
    resampler = av.AudioResampler("fltp", layout, rate)
    try:
        for frame in container.decode(container.streams.audio[0]):
            for piece in resampler.resample(frame):
                yield piece.time, np.asarray(piece.to_ndarray().T, np.float32)
        for piece in resampler.resample(None):
            yield piece.time, np.asarray(piece.to_ndarray().T, np.float32)
    except (av.error.FFmpegError, ValueError) as error:
        warnings.warn(f"{path}: its sound cannot be read to its end ({error})", stacklevel=2)
