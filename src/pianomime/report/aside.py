"""Work that is done aside, on another core, while this thread goes on with its own."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Self

from pianomime.progress import tell

_OFTEN = 0.1
"""[s] between looks at how far it is."""


class AbandonedError(Exception):
    """Nobody waits for the work any more."""


class CountedSteps:
    """Counts the steps of work that is done aside.

    Attributes:
        total: steps in all; 0 as long as that is not known.
        done: steps done.
        abandoned: whether nobody waits for the work any more.
    """

    def __init__(self) -> None:
        self.total, self.done, self.abandoned = 0, 0, False

    def advance(self, steps: int) -> None:
        """Count steps that were done.

        Raises:
            AbandonedError: the work is to end.
        """
        if self.abandoned:
            raise AbandonedError
        self.done += steps


class Aside:
    """Does some work in a thread of its own, which ends with the `with` block at the latest.

    It is for work that leaves Python's lock to others most of the time, as encoders do.

    Args:
        work: is called once, with what counts its steps.
    """

    def __init__(self, work: Callable[[CountedSteps], None]) -> None:
        self._steps = CountedSteps()
        self._pool = ThreadPoolExecutor(1)
        self._done = self._pool.submit(work, self._steps)

    def wait(self, phase: str) -> None:
        """Wait until it is done, and tell how far it is.

        Args:
            phase: what is being done.

        Raises:
            Exception: whatever went wrong in the work.
        """
        while not self._done.done():
            tell(phase, self._steps.done, self._steps.total)
            time.sleep(_OFTEN)
        self._done.result()
        tell(phase, self._steps.total, self._steps.total)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._steps.abandoned = True
        self._pool.shutdown()
