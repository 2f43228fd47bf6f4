"""Signals: one stops the work, a few lines can have it deferred, and Ctrl-C is heard twice."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator

import pytest

from pianomime.stop import Stopped, deferred, stoppable

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals are another thing on Windows")


@pytest.fixture
def received() -> Iterator[list[int]]:
    numbers: list[int] = []
    with stoppable(numbers):
        yield numbers


def _block(done: list[int], *numbers: int, error: Exception | None = None) -> None:
    """Lines that defer signals, which arrive in them; each that did not stop them is noted."""
    with deferred():
        for number in numbers:
            signal.raise_signal(number)
            done.append(number)
        if error is not None:
            raise error


def test_a_signal_is_raised_when_the_lines_that_defer_it_are_done(received: list[int]) -> None:
    done: list[int] = []
    with pytest.raises(Stopped) as stopped:
        _block(done, signal.SIGTERM)
    assert done == received == [signal.SIGTERM]
    assert stopped.value.args == (signal.SIGTERM,)


def test_of_blocks_within_blocks_the_outermost_counts(received: list[int]) -> None:
    done: list[int] = []

    def outermost() -> None:
        with deferred():
            _block(done, signal.SIGHUP)
            _block(done)
            done.append(0)

    with pytest.raises(Stopped):
        outermost()
    assert done == [signal.SIGHUP, 0]


def test_a_signal_goes_before_the_error_of_the_block(received: list[int]) -> None:
    error = OSError("no space")
    with pytest.raises(Stopped) as stopped:
        _block([], signal.SIGTERM, error=error)
    assert stopped.value.__context__ is error


def test_a_block_without_a_signal_changes_nothing(received: list[int]) -> None:
    with pytest.raises(OSError, match="no space"):
        _block([], error=OSError("no space"))
    with pytest.raises(Stopped):
        signal.raise_signal(signal.SIGTERM)


def test_no_signal_is_raised_twice(received: list[int]) -> None:
    with pytest.raises(Stopped):
        _block([], signal.SIGTERM)
    _block([], signal.SIGTERM)  # Clearing away goes on.
    assert received == 2 * [signal.SIGTERM]


@pytest.mark.parametrize("first", [signal.SIGTERM, signal.SIGINT])
def test_who_insists_by_ctrl_c_does_not_wait(first: signal.Signals, received: list[int]) -> None:
    done: list[int] = []
    with pytest.raises(Stopped) as stopped:
        _block(done, first, signal.SIGTERM, signal.SIGINT)
    assert done == [first, signal.SIGTERM]
    assert stopped.value.args == (first,)
    _block([])  # All is said.


def test_where_nothing_is_stoppable_nothing_is_deferred() -> None:
    done: list[int] = []
    with pytest.raises(KeyboardInterrupt):
        _block(done, signal.SIGINT)
    assert not done


def test_another_thread_defers_nothing_for_the_main_one(received: list[int]) -> None:
    within, over = threading.Event(), threading.Event()

    def work() -> None:
        with deferred():
            within.set()
            over.wait()

    thread = threading.Thread(target=work)
    thread.start()
    within.wait()
    try:
        with pytest.raises(Stopped):
            signal.raise_signal(signal.SIGTERM)
    finally:
        over.set()
        thread.join()
