"""The one way in which long work reports how far it is."""

from __future__ import annotations

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
