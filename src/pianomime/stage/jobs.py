"""Jobs of the stage: songs being played, each in a process of its own."""

from __future__ import annotations

import asyncio
import contextlib
import os
import secrets
import shutil
import threading
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from pianomime.replay.blocks import json_block
from pianomime.stage.playing import REPLAY, SOUND, WORKER
from pianomime.workers import Row, Worker, cores

_CHUNK = 1 << 18
_POLL_SECONDS = 0.03
_MOST_DONE = 16
"""Jobs that have ended whose files are kept for pages that still show them."""
_GRACE_SECONDS = 4.0
"""[s] A page that reads no more was closed, if it does not come back within this time."""
_START_SECONDS = 15.0
"""[s] A page that has asked for a job begins to read within this time."""


class Job:
    """A song that is played for a page, or a saved performance that is prepared for it.

    All of it happens in the thread of the server's loop, but for the waiting for its process.

    Attributes:
        number: what it is called.
        page: the seat of a page that asked for it.
        folder: of its files that grow, `REPLAY` and `SOUND`.
        report: folder of the report, when it is done.
        ended: is set when it has, in whatever way.
    """

    def __init__(
        self, number: str, page: str, folder: Path, request: dict[str, Any], worker: Worker
    ) -> None:
        self._worker = worker
        self.number, self.page, self.folder = number, page, folder
        self.request = {**request, "folder": os.fspath(folder)}
        self.report: Path | None = None
        self.ended = asyncio.Event()
        self._failure: str | None = None
        self._readers = 0

    @property
    def done(self) -> bool:
        """Whether it has ended, in whatever way."""
        return self.ended.is_set()

    def start(self) -> None:
        """Have its process do it, which is closed in the end."""
        loop, worker = asyncio.get_running_loop(), self._worker

        def wait() -> None:
            row = worker.ask(self.request)
            worker.close()
            # The loop is closed if the stage was.
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(self._end, row)

        threading.Thread(target=wait, name=f"job {self.number}", daemon=True).start()
        loop.call_later(_START_SECONDS, self._stop_if_alone)

    def stop(self, why: str = "Stopped.") -> None:
        """End it, also in the middle of work."""
        if not self.done:
            self._failure = self._failure or why
            self._worker.stop()

    @property
    def pid(self) -> int:
        """Number of its process."""
        return self._worker.pid

    async def replay(self, closed: Callable[[], bool]) -> AsyncIterator[bytes]:
        """The blocks of the replay, as they come, and in the end why it failed, if it did.

        Args:
            closed: tells whether nobody reads them any more.
        """
        self._readers += 1
        try:
            async for part in self._growing(self.folder / REPLAY, closed):
                yield part
            if self._failure is not None:
                yield json_block("FAIL", {"message": self._failure})
        finally:
            self._readers -= 1
            asyncio.get_running_loop().call_later(_GRACE_SECONDS, self._stop_if_alone)

    def sound(self, closed: Callable[[], bool]) -> AsyncIterator[bytes]:
        """MP3 of what was played, as it comes; `closed` is as for `replay`."""
        return self._growing(self.folder / SOUND, closed)

    async def _growing(self, path: Path, closed: Callable[[], bool]) -> AsyncIterator[bytes]:
        position = 0
        while not closed():
            # Before reading: what was written by then is read.
            done = self.done
            with contextlib.suppress(FileNotFoundError), path.open("rb") as file:
                file.seek(position)
                while part := file.read(_CHUNK):
                    position += len(part)
                    yield part
            if done:
                return
            await asyncio.sleep(_POLL_SECONDS)

    def _end(self, row: Row) -> None:
        if "error" in row:
            self._failure = self._failure or str(row["error"])
        else:
            self.report = Path(row["report"])
            self._failure = None
        self.ended.set()

    def _stop_if_alone(self) -> None:
        if not self._readers:
            self.stop()


class Jobs:
    """All jobs of a stage. A seat of a page has one at a time; a process waits for the next.

    Args:
        folder: for the files of jobs.
        out: folder in which reports of what is played are kept.
    """

    def __init__(self, folder: Path, out: Path) -> None:
        self._folder, self._setup = folder, {"out": os.fspath(out)}
        self._jobs: dict[str, Job] = {}
        self._waiting = self._worker()

    def start(self, page: str, request: dict[str, Any]) -> Job:
        """Begin a job; the one that this page had before is stopped.

        Args:
            page: which seat of which page asks.
            request: for `pianomime.stage.playing`.

        Raises:
            OSError: there is no room for its files.
        """
        number = secrets.token_hex(8)
        folder = self._folder / number
        folder.mkdir()
        mine = [job for job in self._jobs.values() if job.page == page]
        for job in mine:
            job.stop()
        ended = [job for job in self._jobs.values() if job.done]
        # Of what a seat showed before, its last report may be open beside it.
        gone = {*ended[:-_MOST_DONE], *[job for job in mine if job.done][:-1]}
        for job in gone:
            del self._jobs[job.number]
            shutil.rmtree(job.folder, ignore_errors=True)
        job = Job(number, page, folder, request, self._waiting)
        self._waiting = self._worker()
        self._jobs[number] = job
        job.start()
        return job

    def _worker(self) -> Worker:
        return Worker(WORKER, self._setup, threads=cores())

    def get(self, number: str) -> Job | None:
        """The job of a number, or None."""
        return self._jobs.get(number)

    def close(self) -> None:
        """End all processes."""
        for job in self._jobs.values():
            job.stop()
        self._waiting.close()
