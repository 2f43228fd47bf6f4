"""Sound of a video file, in time with its pictures, in constant memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from pianomime.media.opening import open_media
from pianomime.media.sound import steady_sound
from pianomime.music.sound import SAMPLE_RATE
from pianomime.video.film.film import Film


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
        if container.streams.audio:
            yield _reader(steady_sound(film.path, container, SAMPLE_RATE, "stereo", film.start))
        else:
            yield None


def _reader(blocks: Iterator[NDArray[np.float32]]) -> Callable[[int], NDArray[np.float32]]:
    rest = np.empty((0, 2), np.float32)

    def read(samples: int) -> NDArray[np.float32]:
        nonlocal rest
        while len(rest) < samples:
            rest = np.concatenate([rest, next(blocks, np.zeros((samples, 2), np.float32))])
        piece, rest = rest[:samples], rest[samples:]
        return piece

    return read
