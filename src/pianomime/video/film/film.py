"""Reader of video files: frames at a constant rate, whatever the file's own, in constant memory."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.media.opening import open_media, pictures_of
from pianomime.short_repr import short_repr
from pianomime.video.film.read_ahead import ahead

_WIDEST = 1280
"""[pixels] Larger pictures are shrunk to this size, which is enough to see hands and keys."""

_STRIDE = 15
"""Frames between two samples that begin at the same key frame of the video."""
_USUAL_RATE = 30.0
"""[Hz] Assumed rate of a video whose header has none."""

_SHRINKING = av.video.reformatter.Interpolation.AREA


@dataclass(frozen=True)
class Frame:
    """One picture of a video.

    Attributes:
        seconds: time since the first frame of the video [s].
        picture: (height, width, 3) uint8, at the film's working size.
    """

    seconds: float
    picture: NDArray[np.uint8]

    __repr__ = short_repr


class Film:
    """A video file. Every pass over its frames opens the file anew, so passes are independent.

    Attributes:
        path: the file.
        width: width of the pictures, after the rotation that the file asks for [pixels].
        height: height of the pictures, after that rotation [pixels].
        zoom: that size divided by the working size, at which pictures are returned.
        seconds: length of the video from its header [s]; 0 if it has none.
        start: time of the first picture in the file, whose sound may begin elsewhere [s].
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Read the header and the first picture.

        Args:
            path: the file.

        Raises:
            InputError: the file does not exist, is not a video, or has no picture.
        """
        self.path = Path(path)
        if self.path.is_dir():
            raise InputError(f"{self.path}: is a folder, not a video")
        with self._open() as (container, stream):
            first = next(self._decode(container, stream), None)
            if first is None:
                raise InputError(f"{self.path}: no picture in it can be read")
            self._turns = round(getattr(first, "rotation", 0) / 90) % 4
            self.start = first.time or 0.0
            self._timed = first.time is not None
            size = (first.width, first.height)
            self.width, self.height = size if self._turns % 2 == 0 else size[::-1]
            self.zoom = max(1.0, max(size) / _WIDEST)
            self._working = tuple(max(2, round(side / self.zoom)) for side in size)
            self.seconds = _length(container, stream)
            self._interval = 1 / float(stream.average_rate or stream.guessed_rate or _USUAL_RATE)

    @property
    def working_size(self) -> tuple[int, int]:
        """Width and height of the pictures that are returned [pixels]."""
        return round(self.width / self.zoom), round(self.height / self.zoom)

    def frames(self, rate: float, first: int = 0) -> Iterator[Frame]:
        """The frames nearest to n / rate seconds for n = first, first + 1, ... to the end.

        Where the video has no frame near such a time (variable frame rate, dropped frames), the
        last one is repeated. A damaged end is left out, with a warning. A few frames are read ahead
        in another thread.

        Args:
            rate: frames per second [Hz].
            first: number n of the first frame; frames before it are skipped without decoding
                them, if the file allows.
        """
        return ahead(self._frames(rate, first))

    def _frames(self, rate: float, due: int) -> Iterator[Frame]:
        before: tuple[float, Any] | None = None
        last: Frame | None = None
        with self._open() as (container, stream):
            stream.thread_type = "AUTO"
            # If the file has no times, frames can only be counted from its beginning.
            if due and self._timed:
                goal = self.start + due / rate - self._interval
                with suppress(av.error.FFmpegError):
                    container.seek(int(goal / stream.time_base), stream=stream)
            for count, frame in enumerate(self._decode(container, stream)):
                at = count * self._interval if frame.time is None else frame.time - self.start
                while before is not None and due / rate < at:
                    nearest = before if due / rate - before[0] <= at - due / rate else (at, frame)
                    last = self._picture(*nearest, last)
                    yield last
                    due += 1
                before = at, frame
            if before is not None:
                # The last frame lasts as long as any.
                while due / rate < before[0] + min(self._interval, 0.1):
                    last = self._picture(*before, last)
                    yield last
                    due += 1

    def sample(self, count: int) -> list[NDArray[np.uint8]]:
        """Pictures spread over the video.

        Only parts of the video are decoded, if its length is known and the file can be searched.
        Otherwise all of it is decoded, and as few as half of the pictures may be returned.

        Args:
            count: number of pictures.

        Returns:
            Pictures (height, width, 3) uint8 at the working size; none if none can be read.
        """
        return (self._jump(count) if self.seconds else []) or self._pass(count)

    def _pass(self, count: int) -> list[NDArray[np.uint8]]:
        """Every n-th picture of the whole video, with n doubled whenever there are too many."""
        pictures: list[NDArray[np.uint8]] = []
        step = 1
        with self._open() as (container, stream):
            stream.thread_type = "AUTO"
            for number, frame in enumerate(self._decode(container, stream)):
                if number % step:
                    continue
                if len(pictures) == count:
                    pictures = pictures[::2]
                    step *= 2
                    if number % step:
                        continue
                pictures.append(self._picture(0.0, frame, None).picture)
        return pictures

    def _jump(self, count: int) -> list[NDArray[np.uint8]]:
        """Pictures at equal distances, found by jumping to the key frames before them."""
        pictures = []
        visits: dict[float, int] = {}
        with self._open() as (container, stream):
            stream.thread_type = "AUTO"
            for number in range(count):
                goal = self.start + self.seconds * (number + 0.5) / count
                try:
                    container.seek(int(goal / stream.time_base), stream=stream)
                except av.error.FFmpegError:
                    continue
                # Only key frames can be jumped to; where several times lead to the same one, each
                # goes on a little further.
                skip = -1
                latest = None
                for latest in self._decode(container, stream):
                    if skip < 0:
                        key = latest.time or 0.0
                        visits[key] = visits.get(key, -1) + 1
                        skip = _STRIDE * visits[key]
                    if skip == 0 or (latest.time or 0.0) >= goal:
                        break
                    skip -= 1
                if latest is not None:
                    pictures.append(self._picture(0.0, latest, None).picture)
        return pictures

    def _picture(self, seconds: float, frame: Any, last: Frame | None) -> Frame:
        if last is not None and last.seconds == seconds:
            return last
        picture = frame.reformat(*self._working, "rgb24", interpolation=_SHRINKING).to_ndarray()
        return Frame(seconds, np.ascontiguousarray(np.rot90(picture, self._turns)))

    @contextmanager
    def _open(self) -> Iterator[tuple[Any, Any]]:
        """The open file, and its stream of pictures."""
        with open_media(self.path) as container:
            pictures = pictures_of(container)
            if pictures is None:
                raise InputError(f"{self.path}: has no pictures; a video of a keyboard is needed")
            yield container, pictures

    def _decode(self, container: Any, stream: Any) -> Iterator[Any]:
        try:
            yield from container.decode(stream)
        except av.error.FFmpegError as error:
            warnings.warn(f"{self.path}: cannot be read to its end ({error})", stacklevel=3)


def _length(container: Any, stream: Any) -> float:
    if stream.duration is not None:
        return float(stream.duration * stream.time_base)
    return 0.0 if container.duration is None else container.duration / 1e6
