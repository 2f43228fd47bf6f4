"""Stopping: Ctrl-C, SIGTERM and SIGHUP end a program in the same clean way.

Each raises an exception in the main thread, so that whatever is being written is cleared away and
child processes are ended. A signal that the process was told to ignore, as by `nohup`, stays
ignored. A few lines that belong together can have it deferred until they are done.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""The signals that stop; Windows has no SIGHUP."""


class Stopped(KeyboardInterrupt):
    """A signal has asked this process to end; whatever lets Ctrl-C through lets it through."""


class _Deferral:
    """What `deferred` and the handler of `stoppable` know of each other; of the main thread alone.

    Attributes:
        blocks: how many of `deferred` that thread is in.
        number: of the signal that arrived in them; 0 if none has.
    """

    blocks: int = 0
    number: int = 0


_deferral = _Deferral()


@contextmanager
def stoppable(received: list[int], last: bool = False) -> Iterator[None]:
    """Have signals raise `Stopped` in the main thread, whose context this is.

    Other code can turn that exception into another one, such as an ImportError of what was just
    being imported: whoever catches it looks into `received`.

    Args:
        received: gets the numbers of the signals that arrived.
        last: whether the process is at its end afterwards: signals then end it at once. Otherwise
            they do what they did before.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # Signals are none of its business.
        return

    def stop(number: int, _: FrameType | None) -> None:
        # Once is enough: clearing away goes on. But a person may insist.
        first, insists = not received, number == signal.SIGINT
        received.append(number)
        if first and _deferral.blocks:
            _deferral.number = number
        elif first or insists:
            raise Stopped(number)

    report = sys.unraisablehook

    def unraisable(lost: sys.UnraisableHookArgs) -> None:
        # It was raised where Python can only ignore exceptions, such as in a destructor.
        if isinstance(lost.exc_value, Stopped):
            number = signal.Signals(received[0])
            received.clear()
            _thread.interrupt_main(number)
        else:
            report(lost)

    before = {
        number: handler
        for number in SIGNALS
        if (handler := signal.getsignal(number)) not in (signal.SIG_IGN, None)
    }
    try:
        sys.unraisablehook = unraisable
        for number in before:
            signal.signal(number, stop)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if last else handler)
        sys.unraisablehook = report


@contextmanager
def deferred() -> Iterator[None]:
    """Have the signal that stops raise `Stopped` when this block is left, not within it.

    For lines that are done in a moment and of which none may be done without the others. Who
    insists, by Ctrl-C after another signal, need not wait for their end. Where nothing is
    `stoppable`, and in other threads than the main one, this does nothing.

    Raises:
        Stopped: a signal has arrived in the block; in place of what the block itself raised.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _deferral.blocks += 1
    try:
        yield
    finally:
        _deferral.blocks -= 1
        if _deferral.number and not _deferral.blocks:
            number, _deferral.number = _deferral.number, 0
            raise Stopped(number)
