"""CSV tables as they are in exports: UTF-8, commas, decimal points, and names in the first row."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

DIGITS = "%.9g"
"""Nanoradians in angles of up to 1 rad; a file of all digits would be twice as long."""


def write_table(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table.

    Args:
        path: of the table.
        header: names of its columns.
        rows: its cells, each a text or a whole number.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(header)
        table.writerows(rows)


def number_text(value: float) -> str:
    """A number as a cell: empty if it is infinite, as the limit of what has none.

    Args:
        value: to be written.
    """
    return DIGITS % value if math.isfinite(value) else ""
