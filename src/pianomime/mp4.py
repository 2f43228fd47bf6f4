"""MP4 films (H.264, AAC) that are written frame by frame: a picture, and the sound of its time."""

from __future__ import annotations

import os
from contextlib import ExitStack
from fractions import Fraction
from types import TracebackType
from typing import Any, Self

import av
import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE

_SHRINKING = av.video.reformatter.Interpolation.AREA


class Mp4:
    """A film. Use it as a context manager.

    Memory does not grow with the film, because picture and sound of a frame are written together.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        size: tuple[int, int],
        sample_rate: int | None,
        crf: int = 20,
        fps: int = round(FRAME_RATE),
        key_frame_every: int | None = None,
    ) -> None:
        """Open the file.

        Args:
            path: the file.
            size: width and height of the film, both even [pixels].
            sample_rate: of its sound [Hz]; None for a silent film.
            crf: x264's constant rate factor: smaller is better and larger.
            fps: pictures per second.
            key_frame_every: pictures from one that is encoded alone to the next, at most: with few
                of them any picture is found soon, and the file is larger. None for x264's own.

        Raises:
            OSError: the file cannot be written.
        """
        self._size, self._rate, self._fps = size, sample_rate, fps
        self._frame = 0
        # In full: a relative name with a colon would be taken for an address. An index at the front
        # lets a browser start before it has loaded the whole file.
        self._file = av.open(
            os.path.abspath(path), "w", format="mp4", options={"movflags": "+faststart"}
        )
        self._pictures: Any = self._file.add_stream("libx264", rate=fps)
        self._pictures.width, self._pictures.height = size
        self._pictures.pix_fmt = "yuv420p"
        options: dict[str, object] = {"crf": str(crf), "preset": "veryfast"}
        if key_frame_every is not None:
            options["g"] = str(key_frame_every)
        self._pictures.options = options
        self._sound: Any = None
        if sample_rate is not None:
            self._sound = self._file.add_stream("aac", rate=sample_rate, layout="stereo")

    @property
    def span(self) -> tuple[int, int]:
        """First sample of the sound of the next frame, and the one after its last."""
        begin, end = (
            round(at * (self._rate or 0) / self._fps) for at in (self._frame, self._frame + 1)
        )
        return begin, end

    def add(self, picture: NDArray[np.uint8], sound: NDArray[np.float32] | None = None) -> None:
        """Write the next frame.

        Args:
            picture: (height, width, 3) uint8 of any size.
            sound: (s, 2) the samples `span`, -1..1; what is missing is silent.
        """
        large = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        shown = large.reformat(*self._size, "yuv420p", interpolation=_SHRINKING)
        shown.pts, shown.time_base = self._frame, Fraction(1, self._fps)
        self._file.mux(self._pictures.encode(shown))
        if self._sound is not None:
            begin, end = self.span
            samples = np.zeros((2, end - begin), np.float32)
            if sound is not None:
                samples[:, : len(sound)] = sound.T
            heard = av.AudioFrame.from_ndarray(samples, format="fltp", layout="stereo")
            heard.sample_rate = self._sound.rate
            heard.pts, heard.time_base = begin, Fraction(1, self._sound.rate)
            # Right after its picture, which interleaves them in the file.
            self._file.mux(self._sound.encode(heard))
        self._frame += 1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with ExitStack() as stack:
            stack.callback(self._file.close)
            if error is None:
                # What the encoders still hold.
                for stream in (self._pictures, self._sound):
                    if stream is not None:
                        self._file.mux(stream.encode(None))
