"""A recording: the sound of a file, as one channel, in stretches that overlap."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.media.opening import open_media, pictures_of
from pianomime.media.sound import steady_sound
from pianomime.music.score import MAX_SECONDS
from pianomime.short_repr import short_repr

_OWN = 600
"""[s] What a stretch has for its own: hours at once take gigabytes."""
_LAP = 16
"""[s] What it shares with those beside it, so that notes at its ends are heard in full."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of a recording.

    Attributes:
        samples: (S,) float32.
        begin: when the first one is [s].
        own: number of the first sample that is in no stretch before as its own, and of the first
            after it that is another one's.
    """

    samples: NDArray[np.float32]
    begin: float
    own: tuple[int, int]

    __repr__ = short_repr


@dataclass(frozen=True)
class Recording:
    """A file with sound, of a video or alone.

    Attributes:
        path: the file.
        seconds: its length from its header [s]; 0 if it has none.
        start: time in the file of its first picture [s], with which the recording begins; None
            without pictures, where it begins with its first sound.
    """

    path: Path
    seconds: float
    start: float | None

    @classmethod
    def of(cls, path: str | os.PathLike[str]) -> Recording:
        """Read the header.

        Args:
            path: the file.

        Raises:
            InputError: the file does not exist, cannot be read, has no sound, or is too long.
        """
        if Path(path).is_dir():
            raise InputError(f"{path}: is a folder, not a recording")
        with open_media(path, "sound or a video that can be read") as container:
            if not container.streams.audio:
                raise InputError(f"{path}: has no sound")
            seconds = 0.0 if container.duration is None else container.duration / 1e6
            start = _first_picture(container)
        if seconds > MAX_SECONDS:
            raise _too_long(path)
        return cls(Path(path), seconds, start)

    def stretches(self, rate: int, until: float = math.inf) -> Iterator[Stretch]:
        """The whole sound, in order; each of its samples is one stretch's own.

        Args:
            rate: samples per second [Hz].
            until: end of what is any stretch's own [s]; the last one goes on a little, as others
                do. It may be after the end of the sound.

        Raises:
            InputError: the recording is longer than its header says, and too long.
        """
        own, lap = _OWN * rate, _LAP * rate
        last = round(min(until, 2 * MAX_SECONDS) * rate)
        parts: list[NDArray[np.float32]] = []
        first, count, number = 0, 0, 0
        with open_media(self.path, "sound or a video that can be read") as container:
            for block in steady_sound(self.path, container, rate, "mono", self.start):
                parts.append(block[:, 0])
                count += len(block)
                if count > MAX_SECONDS * rate:
                    raise _too_long(self.path)
                if count >= last + lap:
                    break
                while count >= (number + 1) * own + lap:
                    samples = np.concatenate(parts)
                    end = (number + 1) * own
                    yield Stretch(
                        samples[: end + lap - first],
                        first / rate,
                        (number * own - first, end - first),
                    )
                    parts = [samples[end - lap - first :]]
                    first, number = end - lap, number + 1
        samples = np.concatenate([np.empty(0, np.float32), *parts])
        samples = samples[: last + lap - first]
        own_end = min(last - first, len(samples))
        yield Stretch(samples, first / rate, (number * own - first, own_end))


def _first_picture(container: Any) -> float | None:
    """Time of the first picture [s], as `Film.start` has it; None if there is none."""
    pictures = pictures_of(container)
    if pictures is None:
        return None
    try:
        first = next(container.decode(pictures), None)
    except av.error.FFmpegError:
        return None
    return None if first is None else first.time or 0.0


def _too_long(path: str | os.PathLike[str]) -> InputError:
    return InputError(f"{path}: is longer than {MAX_SECONDS / 3600:.0f} hours; cut it")
