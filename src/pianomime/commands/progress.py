"""Progress of long work on stderr: a bar on a terminal, elsewhere a line every half minute."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from pianomime.progress import Progress
from pianomime.shown import shown

_LINE_SECONDS = 30.0
"""[s] between lines, where there is no terminal to draw a bar on."""
_FRAMES_A_SECOND = 5
"""How often a bar is drawn."""
_BAR_WIDTHS = range(10, 41)
"""Columns of a bar: it fills what the words leave, and is left out where that is less."""


@contextmanager
def bars(line_seconds: float = _LINE_SECONDS) -> Iterator[Progress]:
    """Show how far the phase at hand is, and when it will be done.

    A terminal shows one bar, which vanishes at the end; a phase of unknown length pulses. A file, a
    pipe, or a terminal that cannot draw (TERM=dumb) gets a line now and then, also while nothing is
    reported. Work that is done sooner leaves nothing there.

    Args:
        line_seconds: time between lines [s].
    """
    console = Console(stderr=True)
    board = _Shown()
    with ExitStack() as stack:
        # Not what rich takes for a terminal: with FORCE_COLOR that may be a file.
        if sys.stderr.isatty() and not console.is_dumb_terminal:
            live = Live(
                get_renderable=lambda: board,
                console=console,
                transient=True,
                refresh_per_second=_FRAMES_A_SECOND,
            )
            stack.enter_context(live)
        else:
            stack.enter_context(_lines(board, line_seconds))
        yield board.report


@dataclass
class _Phase:
    """What is being done, as it was last reported."""

    name: str
    done: int
    total: int
    remark: str

    def __post_init__(self) -> None:
        # Steps that a run had done before it was resumed say nothing of how long the others take.
        self.first, self.began = self.done, time.monotonic()

    def so_far(self) -> str:
        """How long it has been going on."""
        return f"{_clock(time.monotonic() - self.began)} so far"

    def left(self) -> str:
        """How long it will go on; nothing before its first step is done."""
        steps = self.done - self.first
        if not self.total or steps <= 0:
            return ""
        for_each = (time.monotonic() - self.began) / steps
        return f"{_clock(for_each * max(self.total - self.done, 0))} left"

    def share(self) -> str:
        """What is done, and the total if it is known."""
        if self.total:
            return f"{self.done}/{self.total}"
        return str(self.done) if self.done else ""


class _Shown:
    """The phase at hand, drawn as wide as there is room."""

    def __init__(self) -> None:
        # Replaced or changed field by field by the work, and read by the thread that shows it.
        self.phase: _Phase | None = None

    def report(self, phase: str, done: int, total: int, remark: str = "") -> None:
        """As `Progress`."""
        phase, remark = shown(phase), shown(remark)
        now = self.phase
        if now is None or now.name != phase or done < now.done:
            self.phase = _Phase(phase, done, total, remark)
        else:
            now.done, now.total, now.remark = done, total, remark

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        phase = self.phase
        if phase is None:
            return
        # What matters less comes later, and is left out where there is no room.
        words = [phase.name]
        room = options.max_width - len(phase.name)
        for word in (phase.share(), phase.left(), phase.remark):
            if word and len(word) < room:
                words.append(word)
                room -= len(word) + 1
        so_far = phase.so_far()
        if room - _BAR_WIDTHS.start - 1 > len(so_far):
            words.append(so_far)
            room -= len(so_far) + 1
        cells: list[RenderableType] = [Text(word, no_wrap=True, overflow="crop") for word in words]
        if room > _BAR_WIDTHS.start:
            bar = ProgressBar(
                phase.total or None,
                phase.done,
                width=min(room, _BAR_WIDTHS.stop) - 1,
                pulse=not phase.total,
                animation_time=time.monotonic(),
            )
            cells.insert(1, bar)
        line = Table.grid(padding=(0, 1, 0, 0))
        line.add_row(*cells)
        yield line


@contextmanager
def _lines(board: _Shown, seconds: float) -> Iterator[None]:
    """Print a line about the phase at hand every so many seconds."""
    over = threading.Event()

    def work() -> None:
        while not over.wait(seconds):
            if board.phase is not None:
                print(f"pianomime: {_line(board.phase)}", file=sys.stderr, flush=True)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _line(phase: _Phase) -> str:
    name = " ".join(word for word in (phase.name, phase.share()) if word)
    return ", ".join(word for word in (name, phase.left() or phase.so_far(), phase.remark) if word)


def _clock(seconds: float) -> str:
    minutes, second = divmod(round(seconds), 60)
    hour, minute = divmod(minutes, 60)
    return f"{hour}:{minute:02}:{second:02}"
