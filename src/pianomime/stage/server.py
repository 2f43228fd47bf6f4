"""The server of the stage: for one person, at this machine."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import re
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from tornado.iostream import StreamClosedError
from tornado.web import stream_request_body

from pianomime.closing import Closing
from pianomime.errors import InputError
from pianomime.local_server import Content, LocalHandler, LocalServer
from pianomime.players.registry import EFFORT, player_files, player_names
from pianomime.policies.methods import METHODS
from pianomime.replay.page_script import page_script
from pianomime.shown import shown
from pianomime.stage.jobs import Job, Jobs
from pianomime.stage.library import Library
from pianomime.staging import scratch
from pianomime.web_page import web_page
from pianomime.world_names import WORLDS

LARGEST_SONG = 4_000_000
"""[bytes] Of a MIDI file; those of the longest pieces have a tenth of it."""
_CHUNK = 1 << 18
_KINDS = {
    "performance.mid": "audio/midi",
    "performance.wav": "audio/wav",
    "performance.npz": "application/octet-stream",
    "report.html": "text/html; charset=utf-8",
}
"""Files of a report that may be downloaded, and their media types."""
_PARTS = {
    "performance.mp3": "audio/mpeg",
    "score.mp3": "audio/mpeg",
    "performance.replay.gz": "application/octet-stream",
}
"""Files that the page of a long report reads because it does not hold them; their media types."""
_SPAN = re.compile(r"bytes=([0-9]{0,15})-([0-9]{0,15})")
_BODY = '<script type="module" src="stage.js"></script>\n'
_EFFORTS = range(4)
_NO_PLAYERS_OF_SONGS = ("demonstration", "demonstration-ik", "expert")
"""They play what is given in place of a song."""


class _Handler(LocalHandler):
    """Answers for the stage."""

    def initialize(self, library: Library, jobs: Jobs) -> None:
        self.library, self.jobs = library, jobs

    def refuse(self, status: int, why: object) -> None:
        """Answer with one line for the user."""
        self.set_status(status)
        self.finish(shown(why))

    def answer(self, content: Any) -> None:
        """Answer with JSON."""
        self.set_header("Content-Type", "application/json")
        self.finish(json.dumps(content))

    def job(self, number: str) -> Job | None:
        """A job, or None after an answer that says that there is none."""
        found = self.jobs.get(number)
        if found is None:
            self.refuse(404, "This performance is gone: play it again.")
        return found

    async def send(self, parts: AsyncIterator[bytes]) -> None:
        """Answer with what comes, as it comes, until the page closes."""
        try:
            with contextlib.suppress(StreamClosedError):
                async for part in parts:
                    self.write(part)
                    await self.flush()
        finally:
            await parts.aclose()  # type: ignore[attr-defined]

    def _is_closed(self) -> bool:
        return self.closed

    async def send_part(self, job: Job, name: str) -> None:
        """Answer with a part of the report of a job, once that has ended."""
        await job.ended.wait()
        if job.report is None or not (job.report / name).is_file():
            self.refuse(404, "It is not there.")
        else:
            await self.send_file(job.report / name, _PARTS[name])

    async def send_file(self, path: Path, kind: str) -> None:
        """Answer with a file, or with the part of it that is asked for."""
        self.set_header("Content-Type", kind)
        self.set_header("Accept-Ranges", "bytes")
        size = path.stat().st_size
        first, stop = _range(self.request.headers.get("Range"), size)
        if (first, stop) != (0, size):
            self.set_status(206)
            self.set_header("Content-Range", f"bytes {first}-{stop - 1}/{size}")
        self.set_header("Content-Length", str(stop - first))
        with contextlib.suppress(StreamClosedError), path.open("rb") as file:
            file.seek(first)
            while part := file.read(min(_CHUNK, stop - file.tell())):
                self.write(part)
                await self.flush()


class _Listed(_Handler):
    """What there is to play, and who can."""

    async def get(self) -> None:
        listed = await asyncio.to_thread(self.library.listed)
        players = await asyncio.to_thread(_players)
        self.answer({**listed, "players": players, "worlds": WORLDS, "limit": LARGEST_SONG})


@stream_request_body
class _Songs(_Handler):
    """Takes files that were dropped. They are read as they come, and refused when too large."""

    def prepare(self) -> None:
        super().prepare()
        self._content = bytearray()
        connection: Any = self.request.connection
        connection.set_max_body_size(LARGEST_SONG)
        self._too_large = int(self.request.headers.get("Content-Length", "0")) > LARGEST_SONG
        if self._too_large:
            self.set_header("Connection", "close")
            self.refuse(
                413, f"The file is larger than {LARGEST_SONG // 10**6} MB: no MIDI file is."
            )

    def data_received(self, chunk: bytes) -> None:
        if not self._too_large:
            self._content += chunk

    async def post(self) -> None:
        name = unquote(self.request.headers.get("X-File-Name", "song.mid"))
        try:
            self.answer(await asyncio.to_thread(self.library.upload, name, bytes(self._content)))
        except InputError as error:
            self.refuse(400, error)
        except OSError as error:
            self.refuse(507, f"{name} cannot be kept: {error.strerror or error}")


class _Started(_Handler):
    """Begins to play."""

    def post(self) -> None:
        try:
            asked = json.loads(self.request.body)
            request = _request(asked, self.library)
            job = self.jobs.start(self.request.headers.get("X-Page", ""), request)
            self.answer({"id": job.number})
        except (ValueError, TypeError, KeyError, InputError) as error:
            self.refuse(400, error)
        except OSError as error:
            self.refuse(507, f"Nothing can be played: {error.strerror or error}")


class _Stopped(_Handler):
    """Stops playing."""

    def delete(self, number: str) -> None:
        if (job := self.job(number)) is not None:
            job.stop()
            self.finish()


class _Replay(_Handler):
    """Sends the replay of a job."""

    async def get(self, number: str) -> None:
        if (job := self.job(number)) is not None:
            self.set_header("Content-Type", "application/octet-stream")
            await self.send(job.replay(self._is_closed))


class _Sound(_Handler):
    """Sends the sound of a job: as it comes, or in the end any part of it."""

    async def get(self, number: str) -> None:
        job = self.job(number)
        if job is None:
            return
        if "song" in job.request and not job.done and "whole" not in self.request.query_arguments:
            self.set_header("Content-Type", "audio/mpeg")
            await self.send(job.sound(self._is_closed))
        else:
            await self.send_part(job, "performance.mp3")


class _Wanted(_Handler):
    """Sends the sound of the score."""

    async def get(self, number: str) -> None:
        if (job := self.job(number)) is not None:
            await self.send_part(job, "score.mp3")


class _Files(_Handler):
    """Sends files of a report."""

    for_sandboxed = True

    async def get(self, number: str, name: str) -> None:
        job = self.job(number)
        if job is None:
            return
        if name in _PARTS:
            await self.send_part(job, name)
            return
        if name in _KINDS:
            await job.ended.wait()
        if name not in _KINDS or job.report is None or not (job.report / name).is_file():
            self.refuse(404, "It is not there.")
            return
        if name == "report.html":
            # The page of a report has its script in itself, and at most reads its own parts.
            self.set_header(
                "Content-Security-Policy",
                "default-src 'unsafe-inline' data: blob:; media-src 'self' data: blob:; "
                "connect-src 'self' data: blob:; sandbox allow-scripts allow-downloads",
            )
        else:
            self.set_header("Content-Disposition", f'attachment; filename="{name}"')
        await self.send_file(job.report / name, _KINDS[name])


class Stage(Closing):
    """Serves the stage. Use it as a context manager.

    Attributes:
        url: address of the page, which holds a secret.
        jobs: what is being played.
    """

    def __init__(self, out: Path, given: Sequence[Path], port: int = 0) -> None:
        """Begin to serve.

        Args:
            out: folder in which what is played is kept.
            given: MIDI files, performances, and folders of either.
            port: of the server; 0 for any free one.

        Raises:
            InputError: something given is neither, the page was not built, or the port is in use.
            OSError: the folder cannot be made.
        """
        scripts = {name: page_script(name) for name in ("stage.js",)}
        out.mkdir(parents=True, exist_ok=True)
        library = Library(out, given)
        self._folder = scratch()
        self.jobs = Jobs(self._folder.__enter__(), out)
        stage = {"library": library, "jobs": self.jobs}
        script = "text/javascript; charset=utf-8"
        try:
            self._server = LocalServer(
                {
                    "": (
                        Content,
                        {
                            "kind": "text/html; charset=utf-8",
                            "content": web_page("The stage - PianoMime", _BODY),
                        },
                    ),
                    **{
                        name: (Content, {"kind": script, "content": content})
                        for name, content in scripts.items()
                    },
                    "library": (_Listed, stage),
                    "songs": (_Songs, stage),
                    "jobs": (_Started, stage),
                    "jobs/{}": (_Stopped, stage),
                    "jobs/{}/replay": (_Replay, stage),
                    "jobs/{}/sound": (_Sound, stage),
                    "jobs/{}/wanted": (_Wanted, stage),
                    "jobs/{}/files/{}": (_Files, stage),
                },
                port,
            )
        except BaseException:
            self.jobs.close()
            self._folder.__exit__(None, None, None)
            raise
        self.url = self._server.url
        self._out = out

    def open_browser(self) -> None:
        """Open the page in the user's browser, see `LocalServer.open_browser`."""
        self._server.open_browser(self._out)

    def close(self) -> None:
        """End all that is going on."""
        # First what begins jobs.
        self._server.close()
        self.jobs.close()
        self._folder.__exit__(None, None, None)


def _request(asked: Any, library: Library) -> dict[str, Any]:
    """What a worker is to do.

    Raises:
        InputError: it cannot be done.
        ValueError, TypeError, KeyError: it is nothing that the page asks for.
    """
    if "performance" in asked:
        path = library.path(asked["performance"])
        if path is None:
            raise InputError("This performance is not in the library any more: load the page anew.")
        return {"performance": os.fspath(path)}
    path = library.path(asked["song"])
    if path is None:
        raise InputError("This song is not in the library any more: load the page anew.")
    player, effort, world = str(asked["player"]), asked.get("effort", EFFORT), asked.get("world")
    if player not in player_names():
        raise InputError(f"there is no player {player!r}")
    if effort not in _EFFORTS:
        raise InputError(f"effort is 0 to 3, not {effort!r}")
    if world is not None and world not in WORLDS:
        raise InputError(f"there is no world {world!r}")
    seconds = asked.get("seconds")
    return {
        "song": os.fspath(path),
        "player": player,
        "effort": int(effort),
        "world": world,
        "seconds": None if seconds is None else float(seconds),
    }


def _players() -> list[dict[str, Any]]:
    """Players of songs, and why some cannot play here."""
    listed = []
    for name in player_names():
        if name in _NO_PLAYERS_OF_SONGS:
            continue
        why_not = None
        try:
            if name in METHODS:
                _need_learned()
            player_files(name)
        except (InputError, OSError) as error:
            why_not = shown(error)
        listed.append({"name": name, "why_not": why_not})
    return listed


def _need_learned() -> None:
    from importlib.util import find_spec

    from pianomime.installation import install_command

    if find_spec("onnxruntime") is None:
        raise InputError(f"needs {install_command('learned')}")


def _range(asked: str | None, size: int) -> tuple[int, int]:
    """First byte and the one after the last of what is asked for; all of it if that is unclear."""
    span = _SPAN.fullmatch((asked or "").replace(" ", ""))
    first, last = span.groups() if span else ("", "")
    if not first:
        return (max(size - int(last), 0) if last and int(last) else 0), size
    start, stop = int(first), min(int(last) + 1 if last else size, size)
    return (start, stop) if start < stop else (0, size)
