"""Progress of long work, as it is shown on terminals and in files."""

from __future__ import annotations

import io
import re
import sys
import threading
from collections.abc import Callable

import pytest

from pianomime.commands.progress import bars

_PATIENCE = 30.0
"""[s] until a test gives up on a line that should come."""


class Stream(io.StringIO):
    """A stream that says what it is, and wakes who waits for what is written to it."""

    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self._terminal, self._written = terminal, threading.Condition()

    def isatty(self) -> bool:
        return self._terminal

    def write(self, text: str) -> int:
        with self._written:
            self._written.notify_all()
            return super().write(text)

    def wait(self, pattern: str) -> None:
        """Wait until this was written."""
        with self._written:
            assert self._written.wait_for(lambda: re.search(pattern, self.plain()), _PATIENCE), (
                pattern,
                self.plain(),
            )

    def plain(self) -> str:
        """What was written, without what only moves the cursor or colours."""
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", self.getvalue())


@pytest.fixture
def stderr(monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], Stream]:
    for name in ("FORCE_COLOR", "NO_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")

    def made(terminal: bool) -> Stream:
        stream = Stream(terminal)
        monkeypatch.setattr(sys, "stderr", stream)
        return stream

    return made


def test_a_file_gets_a_line_now_and_then(stderr: Callable[[bool], Stream]) -> None:
    stream = stderr(False)
    with bars(0.01) as progress:
        # Nothing is done yet, or it is not known how much there is.
        progress("loading", 0, 0)
        stream.wait(r"pianomime: loading, 0:00:0\d so far\n")
        progress("training", 50, 200)
        stream.wait(r"pianomime: training 50/200, 0:00:0\d so far\n")
        progress("training", 51, 200, "loss 0.5")
        stream.wait(r"pianomime: training 51/200, \d+:\d\d:\d\d left, loss 0.5\n")
    assert "\x1b" not in stream.getvalue()


def test_a_file_that_is_said_to_have_colours_gets_lines(
    stderr: Callable[[bool], Stream], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    stream = stderr(False)
    with bars(0.01) as progress:
        progress("training", 1, 2)
        stream.wait(r"pianomime: training 1/2")
    assert "\x1b" not in stream.getvalue()


def test_a_terminal_that_cannot_draw_gets_lines(
    stderr: Callable[[bool], Stream], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERM", "dumb")
    stream = stderr(True)
    with bars(0.01) as progress:
        progress("training", 1, 2)
        stream.wait(r"pianomime: training 1/2")
    assert "\x1b" not in stream.getvalue()


def test_quick_work_leaves_nothing_in_a_file(stderr: Callable[[bool], Stream]) -> None:
    stream = stderr(False)
    with bars() as progress:
        progress("training", 1, 2)
        progress("training", 2, 2)
    assert stream.getvalue() == ""


@pytest.mark.parametrize("colours", [True, False])
@pytest.mark.parametrize("width", [60, 80, 200])
def test_what_matters_fits_the_terminal(
    width: int,
    colours: bool,
    stderr: Callable[[bool], Stream],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    if not colours:
        monkeypatch.setenv("NO_COLOR", "1")
    stream = stderr(True)
    with bars() as progress:
        progress("training", 1_000_000, 2_000_000)
        progress("training", 1_500_000, 2_000_000, "F1 0.912, best 0.987")
        stream.wait(r"1500000/2000000 \d+:\d\d:\d\d left F1 0.912, best 0.987")
    lines = re.split(r"[\r\n]+", stream.plain())
    assert max(map(len, lines)) <= width
    if width > 60:
        assert "━" in stream.plain()


def test_what_was_done_before_a_resumption_does_not_shorten_the_time_left(
    stderr: Callable[[bool], Stream], monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = stderr(False)
    clock = [0.0]
    monkeypatch.setattr("pianomime.commands.progress.time.monotonic", lambda: clock[0])
    with bars(0.01) as progress:
        progress("training", 900, 1000)
        clock[0] = 60.0
        progress("training", 910, 1000)
        stream.wait(r"training 910/1000, 0:09:00 left")
        # The same once more, as with the next of several folders.
        progress("training", 0, 10)
        clock[0] = 3720.0
        progress("training", 5, 10)
        stream.wait(r"training 5/10, 1:01:00 left")
