"""Work that is done aside."""

from __future__ import annotations

import threading
import time

import pytest

from pianomime.progress import telling
from pianomime.report.aside import Aside, CountedSteps


def test_it_is_done_while_this_thread_goes_on_and_tells_how_far_it_is() -> None:
    go_on, told = threading.Event(), []

    def work(steps: CountedSteps) -> None:
        steps.total = 4
        steps.advance(1)
        assert go_on.wait(10)
        steps.advance(3)

    def note(phase: str, done: int, total: int, remark: str = "") -> None:
        told.append((phase, done, total))
        go_on.set()

    with telling(note), Aside(work) as aside:
        aside.wait("sound")
    assert told[-1] == ("sound", 4, 4)
    assert {phase for phase, _, _ in told} == {"sound"}


def test_what_goes_wrong_is_told_where_it_is_waited_for() -> None:
    def work(_: CountedSteps) -> None:
        raise OSError("no space")

    with pytest.raises(OSError, match="no space"), Aside(work) as aside:
        aside.wait("sound")


def test_work_that_nobody_waits_for_ends_soon() -> None:
    ended = threading.Event()

    def work(steps: CountedSteps) -> None:
        try:
            for _ in range(10_000):
                time.sleep(0.01)
                steps.advance(1)
        finally:
            ended.set()

    def stopped() -> None:
        with Aside(work):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert ended.is_set()
