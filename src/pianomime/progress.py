"""The one way in which long work reports how far it is."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol


class Progress(Protocol):
    """A callback that long work calls as it goes on."""

    def __call__(self, phase: str, done: int, total: int, remark: str = "") -> None:
        """Take note of the progress.

        Args:
            phase: what is being done, such as "planning"; a new phase is a new progress bar.
            done: steps done so far.
            total: steps in all; 0 where that is not known.
            remark: anything to show beside it, such as the mean F1 so far.
        """


def no_progress(phase: str, done: int, total: int, remark: str = "") -> None:
    """The callback of callers that do not want to know."""


def ignore(steps: int) -> None:
    """Takes no note of steps that were done."""


_told: ContextVar[Progress] = ContextVar("told", default=no_progress)


@contextmanager
def telling(progress: Progress) -> Iterator[None]:
    """Have a callback told, within the block, what `tell` and `Steps` say.

    So a planner or a tracker can say how far it is, though `plan(score)` and `start(plan)` take no
    callback.

    Args:
        progress: the callback.
    """
    before = _told.set(progress)
    try:
        yield
    finally:
        _told.reset(before)


def tell(phase: str, done: int, total: int, remark: str = "") -> None:
    """Tell whoever is listening, see `telling`; the arguments are those of `Progress`."""
    _told.get()(phase, done, total, remark)


class Steps:
    """Counts the steps of one phase, and tells how many are done.

    Args:
        phase: what is being done.
        total: steps in all.
    """

    def __init__(self, phase: str, total: int) -> None:
        self._phase, self._total, self._done = phase, total, 0
        tell(phase, 0, total)

    def advance(self, steps: int) -> None:
        """Count steps that were done."""
        self._done += steps
        tell(self._phase, self._done, self._total)
