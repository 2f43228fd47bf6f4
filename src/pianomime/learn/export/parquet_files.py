"""Parquet files of an export for LeRobot: tables of frames, and rows about episodes."""

from __future__ import annotations

import os
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from pianomime.learn.export.numbered_files import NumberedFiles


class ParquetFiles(NumberedFiles):
    """Parquet files, of one row group for what is written at once.

    Args:
        folder: that the paths are in.
        pattern: of a path, with `chunk_index` and `file_index`.
        most: size of a file at most [MiB].
        schema: of the files.
    """

    def __init__(self, folder: Path, pattern: str, most: float, schema: pa.Schema) -> None:
        super().__init__(folder, pattern, most)
        self.schema = schema
        self._sink: Any = None
        self._writer: Any = None

    def write(self, table: pa.Table) -> tuple[int, int]:
        """Write rows as one row group; returns the indices of their chunk and file."""
        chunk, file, _ = self.place(len(table))
        self._writer.write_table(table)
        return chunk, file

    def write_row(self, row: dict[str, Any]) -> None:
        """Write one row about an episode, with the place where it is."""
        chunk, file, _ = self.place(1)
        row = {**row, "meta/episodes/chunk_index": chunk, "meta/episodes/file_index": file}
        self._writer.write_table(pa.Table.from_pylist([row], self.schema))

    def _begin(self, path: Path, stack: ExitStack) -> None:
        # As bytes: those of a name need not be UTF-8, which text is turned into.
        self._sink = stack.enter_context(pa.OSFile(os.fsencode(path), "wb"))
        self._writer = stack.enter_context(
            pq.ParquetWriter(self._sink, self.schema, compression="snappy")
        )

    def _size(self) -> int:
        size: int = self._sink.tell()
        return size
