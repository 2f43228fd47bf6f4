"""Numbered files: rows that fill one file after the other, each up to a size, as LeRobot has it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

FILES_IN_CHUNK = 1000
"""Files in a folder, as LeRobot has them by default."""


class NumberedFiles(ABC):
    """Files of one kind, of which one is open. Use it as a context manager.

    Args:
        folder: that the paths are in.
        pattern: of a path, with `chunk_index` and `file_index`.
        most: size of a file at most [MiB]; what is placed at once may be larger.
    """

    def __init__(self, folder: Path, pattern: str, most: float) -> None:
        self._folder, self._pattern, self._most = folder, pattern, most
        self._number, self._rows = -1, 0
        self._open = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._open.__exit__(kind, error, trace)

    def place(self, count: int) -> tuple[int, int, int]:
        """Where the next rows go; a new file is begun where one is full.

        Args:
            count: rows, which must be written then.

        Returns:
            The indices of their chunk and file, and the rows that the file has before them.
        """
        # As LeRobot does it: by the size on disk of the rows that are there.
        full = self._number < 0
        if not full:
            size = self._size()
            full = size + size / self._rows * count >= self._most * 1024**2
        if full:
            self._open.close()
            self._number, self._rows = self._number + 1, 0
        chunk, file = divmod(self._number, FILES_IN_CHUNK)
        if full:
            path = self._folder / self._pattern.format(chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._begin(path, self._open)
        before = self._rows
        self._rows += count
        return chunk, file, before

    @abstractmethod
    def _begin(self, path: Path, stack: ExitStack) -> None:
        """Open a file.

        Args:
            path: of the file, which is not there yet.
            stack: closes what is entered into it when the file is full.
        """

    @abstractmethod
    def _size(self) -> int:
        """Bytes of the open file on disk."""
