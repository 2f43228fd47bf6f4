"""Worker processes: rows whatever happens, and nothing outlives who asked."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pianomime.errors import InputError
from pianomime.workers import Worker, cores, work

THIS = "test_workers:load"


def load(setup: Any) -> Callable[[Any], dict[str, Any]]:
    """What the processes of these tests do."""
    print("printed while it loads")
    if setup == "broken":
        raise InputError("cannot be loaded")

    def answer(request: Any) -> dict[str, Any]:
        print("printed while it works", flush=True)
        kind, value = request
        if kind == "crash":
            os.kill(os.getpid(), signal.SIGKILL)
        if kind == "refuse":
            raise InputError(value)
        if kind == "bug":
            return {"row": 1 / value}
        if kind == "nan":
            return {"row": float("nan")}
        if kind == "write":
            Path(value).write_text(str(os.getpid()))
        if kind in ("sleep", "write"):
            time.sleep(600)
        return {"row": value, "setup": setup, "threads": os.environ["OMP_NUM_THREADS"]}

    return answer


def test_requests_are_answered_by_what_was_set_up_once() -> None:
    with Worker(THIS, {"a": [1]}) as worker:
        pid = worker.pid
        for value in (1, "ä\n", {"x": None}, "x" * 300_000):
            assert worker.ask(("echo", value)) == {
                "row": value,
                "setup": {"a": [1]},
                "threads": "1",
            }
        assert worker.pid == pid


def test_exceptions_and_crashes_cost_one_request() -> None:
    with Worker(THIS) as worker:
        assert worker.ask(("refuse", "no such song")) == {"error": "no such song"}
        bug = worker.ask(("bug", 0))["error"]
        assert bug.startswith("ZeroDivisionError: division by zero (test_workers.py:")
        assert "error" in worker.ask(("nan", 0))
        pid = worker.pid
        assert worker.ask(("crash", 0)) == {"error": "its process died (exit code -9)"}
        assert worker.ask(("echo", 5))["row"] == 5
        assert worker.pid != pid


@pytest.mark.parametrize(
    ("function", "setup", "message"),
    [
        (THIS, "broken", "cannot be loaded"),
        ("no_such_module:load", None, "No module named 'no_such_module'"),
        ("test_workers:nothing", None, "nothing"),
    ],
)
def test_what_cannot_be_loaded_is_told_of_every_request(
    function: str, setup: Any, message: str
) -> None:
    with Worker(function, setup) as worker:
        for _ in range(2):
            assert message in worker.ask(("echo", 1))["error"]


def test_a_pool_gives_each_item_its_row() -> None:
    items = [*range(20), "crash"]
    rows = dict(work(THIS, items, 3, request=lambda item: (str(item), item)))
    assert rows.keys() == {*items}
    assert "died" in rows.pop("crash")["error"]
    assert all(row["row"] == item for item, row in rows.items())
    assert list(work(THIS, [], 3)) == []


@pytest.mark.parametrize("jobs", [0, -1])
def test_a_pool_of_no_processes_is_refused(jobs: int) -> None:
    with pytest.raises(InputError, match="jobs must be 1 or more"):
        list(work(THIS, [1], jobs))


def test_requests_are_made_when_their_turn_comes() -> None:
    made: list[int] = []

    def request(item: int) -> tuple[str, int]:
        made.append(item)
        return "echo", item

    pool = work(THIS, range(9), 2, request=request)
    next(pool)
    assert len(made) < 9
    assert len(list(pool)) == 8
    assert made == [*range(9)]


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_no_process_outlives_a_pool_that_is_closed(
    error: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[subprocess.Popen[str]] = []
    start = Worker._start

    def note(worker: Worker) -> subprocess.Popen[str]:
        started.append(start(worker))
        return started[-1]

    monkeypatch.setattr(Worker, "_start", note)
    before = set(threading.enumerate())
    pool = work(THIS, [("echo", 1), ("sleep", 2), ("sleep", 3)], 3)
    assert next(pool)[1]["row"] == 1
    with pytest.raises(error):
        pool.throw(error())
    assert len(started) == 3
    assert all(process.poll() is not None for process in started)
    assert set(threading.enumerate()) == before


def test_a_worker_ends_in_the_middle_of_work_when_who_asked_is_killed(tmp_path: Path) -> None:
    note = tmp_path / "pid"
    script = (
        "import sys\n"
        "from pianomime.workers import Worker\n"
        f"Worker({THIS!r}).ask(('write', {str(note)!r}))\n"
    )
    places = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    asking = subprocess.Popen(
        [sys.executable, "-c", script], env={**os.environ, "PYTHONPATH": places}
    )
    pid = _eventually(lambda: note.exists() and note.read_text())
    assert _alive(int(pid))
    asking.kill()
    asking.wait()
    assert _eventually(lambda: not _alive(int(pid)))


@pytest.mark.skipif(sys.platform != "linux", reason="only the kernel of Linux does this")
def test_the_kernel_ends_a_worker_whose_input_another_process_holds_open(tmp_path: Path) -> None:
    note = tmp_path / "pid"
    # As a process does that was forked from who asked: the end of the input is never seen.
    script = (
        "import os, subprocess, sys\n"
        "from pianomime.workers import Worker\n"
        f"worker = Worker({THIS!r})\n"
        "held = worker._process.stdin.fileno()\n"
        "holder = subprocess.Popen(['sleep', '600'], pass_fds=[held], stdout=subprocess.DEVNULL)\n"
        "print(holder.pid, flush=True)\n"
        f"worker.ask(('write', {str(note)!r}))\n"
    )
    places = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    asking = subprocess.Popen(
        [sys.executable, "-c", script],
        env={**os.environ, "PYTHONPATH": places},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert asking.stdout is not None
    holder = int(asking.stdout.readline())
    try:
        pid = int(_eventually(lambda: note.exists() and note.read_text()))
        asking.kill()
        asking.communicate()
        assert _eventually(lambda: not _alive(pid))
        assert _alive(holder)
    finally:
        os.kill(holder, signal.SIGKILL)


def test_it_is_cheap_to_import() -> None:
    heavy = "('numpy', 'torch', 'mujoco', 'rich')"
    script = f"import sys, pianomime.workers; print([n for n in {heavy} if n in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


def test_cores_are_those_of_this_process() -> None:
    if hasattr(os, "sched_getaffinity"):
        assert cores() == len(os.sched_getaffinity(0))
    assert cores() >= 1


def _eventually(what: Callable[[], Any]) -> Any:
    deadline = time.monotonic() + 30
    while not (found := what()):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return found


def _alive(pid: int) -> bool:
    try:
        state = Path("/proc", str(pid), "stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"
