"""A progress bar with the time left, shown on stderr when that is a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


class Tell(Protocol):
    """What to call to move a bar."""

    def __call__(self, stage: str, done: int, total: int, remark: str = "") -> None:
        """Tell the stage, the steps done, the steps in all (0: unknown) and a remark."""


@contextmanager
def bars() -> Iterator[Tell]:
    """Show one bar a stage; a stage of unknown length pulses until the next one begins."""
    console = Console(stderr=True)
    with Progress(
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
    ) as progress:
        current: tuple[str, TaskID] | None = None

        def tell(stage: str, done: int, total: int, remark: str = "") -> None:
            nonlocal current
            if current is None or current[0] != stage:
                if current is not None:
                    progress.remove_task(current[1])
                current = stage, progress.add_task(stage, total=total or None, remark=remark)
            progress.update(current[1], completed=done, total=total or None, remark=remark)

        yield tell
