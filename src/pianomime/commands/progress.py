"""A progress bar with the time left, shown on stderr when that is a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bars

from pianomime.progress import Progress


@contextmanager
def bars() -> Iterator[Progress]:
    """Show one bar a phase; a phase of unknown length pulses until the next one begins."""
    console = Console(stderr=True)
    with Bars(
        TextColumn("{task.description:<10}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left:"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[remark]}"),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as shown:
        current: tuple[str, TaskID] | None = None

        def progress(phase: str, done: int, total: int, remark: str = "") -> None:
            nonlocal current
            if current is None or current[0] != phase:
                if current is not None:
                    shown.remove_task(current[1])
                current = phase, shown.add_task(phase, total=total or None, remark=remark)
            shown.update(current[1], completed=done, total=total or None, remark=remark)

        yield progress
