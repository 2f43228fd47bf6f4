"""Sound of a video file, in time with its pictures, in constant memory."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from pianomime.music.sound import SAMPLE_RATE
from pianomime.video.film.film import Film
from pianomime.video.film.media import open_media

_JITTER = SAMPLE_RATE // 20
"""[samples] Smaller gaps and overlaps in a file's times are those of rounding."""


@contextmanager
def film_sound(film: Film) -> Iterator[Callable[[int], NDArray[np.float32]] | None]:
    """The sound of a film, read from its beginning on.

    Yields a function that returns the next samples (s, 2) at `SAMPLE_RATE`, given how many, or None
    if the film has no sound. The first are those of the first picture; where there is no sound, and
    after its end, there is silence.

    Args:
        film: the video.

    Raises:
        InputError: the file cannot be opened any more.
    """
    with open_media(film.path) as container:
        streams = container.streams.audio
        yield _reader(_steady(film, container, streams[0])) if streams else None


def _reader(blocks: Iterator[NDArray[np.float32]]) -> Callable[[int], NDArray[np.float32]]:
    rest = np.empty((0, 2), np.float32)

    def read(samples: int) -> NDArray[np.float32]:
        nonlocal rest
        while len(rest) < samples:
            rest = np.concatenate([rest, next(blocks, np.zeros((samples, 2), np.float32))])
        piece, rest = rest[:samples], rest[samples:]
        return piece

    return read


def _steady(film: Film, container: Any, stream: Any) -> Iterator[NDArray[np.float32]]:
    """Blocks of sound without gaps between them, the first at the first picture."""
    done = 0
    for seconds, block in _decoded(film, container, stream):
        begin = done if seconds is None else round((seconds - film.start) * SAMPLE_RATE)
        while begin - done > _JITTER:
            gap = min(begin - done, SAMPLE_RATE)
            yield np.zeros((gap, 2), np.float32)
            done += gap
        if done - begin > _JITTER:
            block = block[done - begin :]
        yield block
        done += len(block)


def _decoded(
    film: Film, container: Any, stream: Any
) -> Iterator[tuple[float | None, NDArray[np.float32]]]:
    """Time in the file [s] and samples of each block; a damaged end is left out."""
    resampler = av.AudioResampler("fltp", "stereo", SAMPLE_RATE)
    try:
        for frame in container.decode(stream):
            for piece in resampler.resample(frame):
                yield piece.time, np.asarray(piece.to_ndarray().T, np.float32)
        for piece in resampler.resample(None):
            yield piece.time, np.asarray(piece.to_ndarray().T, np.float32)
    except (av.error.FFmpegError, ValueError) as error:
        warnings.warn(f"{film.path}: its sound cannot be read to its end ({error})", stacklevel=2)
