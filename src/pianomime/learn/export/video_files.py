"""Video files of an export for LeRobot: pictures of episodes, one after the other."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE
from pianomime.learn.export.numbered_files import NumberedFiles
from pianomime.mp4 import Mp4

_KEY_FRAME_EVERY = 2
"""Pictures, as LeRobot has it by default: policies are trained on pictures in any order."""


@dataclass(frozen=True)
class Span:
    """Where the pictures of an episode are.

    Attributes:
        chunk: index of the folder.
        file: index of the file in it.
        begin: time of the first picture in the file [s].
        end: time at which the last one is over [s].
    """

    chunk: int
    file: int
    begin: float
    end: float


class VideoFiles(NumberedFiles):
    """MP4 files (H.264), of one picture a frame.

    Args:
        folder: that the paths are in.
        pattern: of a path, with `chunk_index` and `file_index`.
        most: size of a file at most [MiB].
        size: width and height [pixels], both even.
    """

    def __init__(self, folder: Path, pattern: str, most: float, size: tuple[int, int]) -> None:
        super().__init__(folder, pattern, most)
        self._film_size = size
        self._path: Path
        self._film: Mp4

    def begin(self, frames: int) -> Span:
        """Begin an episode, all of whose pictures must be added then.

        Args:
            frames: of the episode.
        """
        chunk, file, before = self.place(frames)
        return Span(chunk, file, before / FRAME_RATE, (before + frames) / FRAME_RATE)

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Write the next picture (height, width, 3) uint8."""
        self._film.add(picture)

    def _begin(self, path: Path, stack: ExitStack) -> None:
        self._path = path
        self._film = stack.enter_context(
            Mp4(path, self._film_size, None, key_frame_every=_KEY_FRAME_EVERY)
        )

    def _size(self) -> int:
        # The encoder holds some tens of pictures back: little beside a full file.
        return self._path.stat().st_size
