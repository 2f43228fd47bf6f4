"""Worker processes: requests go in as lines of JSON, and rows come out as lines of JSON.

The work is named as "package.module:function". The function is called once in the new
process with a setup, and returns what answers requests: that is where a player or a network is
loaded. An exception costs one request, and so does a crash, after which the process is started
again. The process ends when its input does, also in the middle of work, and so does not outlive the
process that asked, however that ends.

These are plain processes, rather than forks or children of `multiprocessing`, so that a script that
starts some needs no `if __name__ == "__main__"`, and libraries with threads are safe.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import queue
import subprocess
import sys
import threading
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

from pianomime.errors import InputError

Row = dict[str, Any]
"""What became of a request; one that failed has an `error`."""
Answer = Callable[[Any], Row]
"""Does what a request asks for; both are what JSON can hold."""

_Item = TypeVar("_Item")


def cores() -> int:
    """The number of cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):  # Linux; a container often allows fewer than there are.
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def work(
    function: str,
    items: Iterable[_Item],
    jobs: int,
    setup: Any = None,
    request: Callable[[_Item], Any] = lambda item: item,
) -> Generator[tuple[_Item, Row], None, None]:
    """Items with their rows, in the order in which they are done.

    Closing the generator ends all its processes, also in the middle of work.

    Args:
        function: what loads what answers, as "package.module:function".
        items: what is to be done.
        jobs: processes at most.
        setup: what the function is given, for JSON.
        request: the request of an item, for JSON; called in this process just before the item is
            worked on.
    """
    waiting = deque(items)
    workers = [Worker(function, setup) for _ in range(min(jobs, len(waiting)))]
    if not workers:
        return
    idle, running = list(workers), dict[Future[Row], tuple[_Item, Worker]]()
    # The threads only wait for the processes.
    threads = ThreadPoolExecutor(len(workers))
    done: list[tuple[_Item, Row]] = []
    try:
        while True:
            # Before rows are handed out, which may take a while.
            while idle and waiting:
                item, worker = waiting.popleft(), idle.pop()
                running[threads.submit(worker.ask, request(item))] = item, worker
            yield from done
            if not running:
                return
            done = []
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                item, worker = running.pop(future)
                done.append((item, future.result()))
                idle.append(worker)
    finally:
        for worker in workers:
            worker.close()
        threads.shutdown()


class Worker:
    """A process that works for this one, started at once, and again after a crash.

    Args:
        function: what loads what answers, as "package.module:function".
        setup: what the function is given, for JSON.
    """

    def __init__(self, function: str, setup: Any = None) -> None:
        self._function, self._setup = function, json.dumps(setup)
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

    def close(self) -> None:
        """End the process for good, also in the middle of work."""
        with self._lock:
            self._closed = True
        self._process.kill()
        self._process.wait()

    def _start(self) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            # Not -m alone, which would look for modules in the present folder first.
            [sys.executable, "-P", "-m", "pianomime.workers", self._function],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            encoding="utf-8",
            env={
                **os.environ,
                # What can be imported here can be imported there.
                "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path),
                # One item a core: more threads in each would only get in each other's way.
                "OMP_NUM_THREADS": "1",
                "OPENBLAS_NUM_THREADS": "1",
            },
            # Ctrl-C is for the process that asked, which then ends this one.
            start_new_session=True,
        )
        assert process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # The first request finds out.
            print(self._setup, file=process.stdin, flush=True)
        return process

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def answered(answer: Answer, request: Any) -> Row:
    """The row of a request, whatever happens."""
    try:
        return answer(request)
    except (InputError, OSError) as error:
        return {"error": str(error)}
    except Exception as error:  # A bug of ours must not cost the other items either.
        where = traceback.extract_tb(error.__traceback__)[-1]
        reason = f"{type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})"
        return {"error": reason}


def _release(process: subprocess.Popen[str]) -> None:
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(BrokenPipeError):  # It had not read everything.
                stream.close()


def _loaded(function: str, setup: Any) -> Answer:
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
    answer = _loaded(sys.argv[1], json.loads(requests.get()))

    def checked(request: Any) -> Row:
        row = answer(request)
        json.dumps(row, allow_nan=False)
        return row

    while True:
        row = answered(checked, json.loads(requests.get()))
        print(json.dumps(row, allow_nan=False), file=answers, flush=True)


if __name__ == "__main__":
    main()
