"""Worker processes: requests go in as lines of JSON, and rows come out as lines of JSON.

The work is named as "package.module:function". The function is called once in the new
process with a setup, and returns what answers requests: that is where a player or a network is
loaded. An exception costs one request, and so does a crash, after which the process is started
again. The process ends when its input does, also in the middle of work, and so does not outlive the
process that asked, however that ends; on Linux the kernel sees to it as well. One that is closed
may clear away what it was writing.

These are plain processes, rather than forks or children of `multiprocessing`, so that a script that
starts some needs no `if __name__ == "__main__"`, and libraries with threads are safe.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Collection, Generator, Iterable
from pathlib import Path
from typing import Any, TextIO, TypeVar

from pianomime.closing import Closing
from pianomime.errors import InputError, WorkFailed
from pianomime.shown import shown
from pianomime.stop import Stopped, stoppable

Row = dict[str, Any]
"""What became of a request; one that failed has an `error`."""
Answer = Callable[[Any], Row]
"""Does what a request asks for; both are what JSON can hold."""

_Item = TypeVar("_Item")

_GRACE = 2.0
"""[s] for a process that is closed to clear away what it was writing."""
_PR_SET_PDEATHSIG = 1
"""Linux: have a signal sent to this process when the thread that started it ends."""


def unwritable(name: str, reason: str) -> WorkFailed:
    """What ends the work on many songs when what was made of one cannot be kept.

    That is no fault of the song: the next one could not be kept either.

    Args:
        name: of the song, or of the file.
        reason: why it cannot be written.
    """
    return WorkFailed(
        f"{shown(name)}: cannot be kept: {reason}; all songs finished before are kept, and the "
        "same command goes on"
    )


def cores() -> int:
    """The number of cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):  # Linux; a container often allows fewer than there are.
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def work(
    function: str,
    items: Iterable[_Item],
    jobs: int | None,
    setup: Any = None,
    request: Callable[[_Item], Any] = lambda item: item,
) -> Generator[tuple[_Item, Row], None, None]:
    """Items with their rows, in the order in which they are done.

    Closing the generator ends all its processes, also in the middle of work.

    Args:
        function: what loads what answers, as "package.module:function".
        items: what is to be done.
        jobs: processes at most; one a core that this one may use if None.
        setup: what the function is given, for JSON.
        request: the request of an item, for JSON; called in this process just before the item is
            worked on.

    Raises:
        InputError: there is less than one process.
    """
    jobs = cores() if jobs is None else jobs
    if jobs < 1:
        raise InputError(f"jobs must be 1 or more, not {jobs}")
    waiting = deque(items)
    workers = [Worker(function, setup) for _ in range(min(jobs, len(waiting)))]
    if not workers:
        return
    rows: queue.SimpleQueue[tuple[Worker, _Item, Row | Exception]] = queue.SimpleQueue()

    def ask(worker: Worker, item: _Item, asked: Any) -> None:
        try:
            rows.put((worker, item, worker.ask(asked)))
        except Exception as error:  # For who waits, not for this thread.
            rows.put((worker, item, error))

    idle, running = list(workers), dict[Worker, threading.Thread]()
    done: list[tuple[_Item, Row]] = []
    try:
        while True:
            # Before rows are handed out, which may take a while.
            while idle and waiting:
                worker, item = idle.pop(), waiting.popleft()
                # It only waits for the process; the end of this one must not wait for it.
                thread = threading.Thread(
                    target=ask, args=(worker, item, request(item)), daemon=True
                )
                running[worker] = thread
                thread.start()
            yield from done
            if not running:
                return
            worker, item, row = rows.get()
            running.pop(worker).join()
            if isinstance(row, Exception):
                raise row
            idle.append(worker)
            done = [(item, row)]
    finally:
        for worker in workers:
            worker.stop()
        for worker in workers:
            worker.close()
        for thread in running.values():
            if thread.ident is not None:
                thread.join()


class Worker(Closing):
    """A process that works for this one, started at once, and again after a crash.

    Args:
        function: what loads what answers, as "package.module:function".
        setup: what the function is given, for JSON.
        threads: for linear algebra; where there is a process for each core, more than one would
            only get in each other's way.
    """

    def __init__(self, function: str, setup: Any = None, threads: int = 1) -> None:
        self._function, self._setup, self._threads = function, json.dumps(setup), threads
        # One thread may wait for a row in `ask` while another calls `close`.
        self._lock = threading.Lock()
        self._closed = False
        self._process = self._start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def ask(self, request: Any) -> Row:
        """Have a request answered, and wait for the row."""
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            print(json.dumps(request), file=process.stdin, flush=True)
            line = process.stdout.readline()
        except (BrokenPipeError, ValueError):  # It crashed, or was closed.
            line = ""
        if line.endswith("\n"):
            row: Row = json.loads(line)
            return row
        code = process.wait()
        with self._lock:
            if not self._closed:
                _release(process)
                self._process = self._start()
        return {"error": f"its process died (exit code {code})"}

    def stop(self) -> None:
        """Ask the process to end, without waiting for it."""
        with self._lock:
            self._closed = True
        self._process.terminate()

    def close(self) -> None:
        """End the process for good, also in the middle of work."""
        self.stop()
        try:
            self._process.wait(_GRACE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _start(self) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            # Not -m alone, which would look for modules in the present folder first.
            [sys.executable, "-P", "-m", "pianomime.workers", self._function, _lasting_pid()],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            encoding="utf-8",
            env={
                **os.environ,
                # What can be imported here can be imported there.
                "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path),
                "OMP_NUM_THREADS": str(self._threads),
                "OPENBLAS_NUM_THREADS": str(self._threads),
            },
            # Ctrl-C is for the process that asked, which then ends this one.
            start_new_session=True,
        )
        assert process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # The first request finds out.
            print(self._setup, file=process.stdin, flush=True)
        return process


def answered(answer: Answer, request: Any) -> Row:
    """The row of a request, whatever happens."""
    try:
        return answer(request)
    except (InputError, WorkFailed, OSError) as error:
        return {"error": shown(error)}
    except Exception as error:  # A bug of ours must not cost the other items either.
        where = traceback.extract_tb(error.__traceback__)[-1]
        reason = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
        return {"error": shown(reason)}


def _lasting_pid() -> str:
    """The number of this process, where its present thread lasts as long as the process."""
    lasts = threading.current_thread() is threading.main_thread()
    return str(os.getpid()) if lasts else "0"


def _end_with(parent: int) -> None:
    """Have the kernel end this process with the one that started it, where it can.

    Args:
        parent: number of that process; 0 if it is a thread that may end before.
    """
    if parent and sys.platform == "linux":
        import ctypes

        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # It ended before that.
            os._exit(0)


def _release(process: subprocess.Popen[str]) -> None:
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(BrokenPipeError):  # It had not read everything.
                stream.close()


def load_answer(function: str, setup: Any) -> Answer:
    """Load what answers requests; one that cannot be loaded answers each with the reason.

    Args:
        function: what loads it, as "package.module:function".
        setup: what the function is given.
    """
    module, _, name = function.partition(":")
    try:
        answer: Answer = getattr(importlib.import_module(module), name)(setup)
    except Exception as error:
        failed = error  # Each request is answered with the reason.

        def refuse(request: Any) -> Row:
            raise failed

        return refuse
    return answer


def main() -> None:
    """Answer until the input ends."""
    # Ctrl-C is for the process that asked, also where this one has no session of its own.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _end_with(int(sys.argv[2]))
    requests: queue.SimpleQueue[str] = queue.SimpleQueue()

    def read() -> None:
        for line in sys.stdin:
            requests.put(line)
        os._exit(0)

    # A thread reads, so that the end of the input is seen in the middle of work.
    threading.Thread(target=read, daemon=True).start()
    # Anything that a library prints must not get between the rows.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    # What warnings tell, such as that the physics broke, is counted in the rows.
    warnings.simplefilter("ignore")
    received: list[int] = []
    with contextlib.suppress(Stopped), stoppable(received, last=True):
        _answer_all(requests, answers, received)
    # What was being written is cleared away. The end of the interpreter would take longer.
    os._exit(128 + received[0])


def _answer_all(
    requests: queue.SimpleQueue[str], answers: TextIO, received: Collection[int]
) -> None:
    """Answer until a signal is received, also where that was turned into another error."""
    answer = load_answer(sys.argv[1], json.loads(requests.get()))

    def checked(request: Any) -> Row:
        row = answer(request)
        json.dumps(row, allow_nan=False)
        return row

    while not received:
        row = answered(checked, json.loads(requests.get()))
        print(json.dumps(row, allow_nan=False), file=answers, flush=True)


if __name__ == "__main__":
    main()
