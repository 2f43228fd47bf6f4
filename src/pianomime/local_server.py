"""A web server for one person at this machine: pages that only its secret address opens.

Any page in a browser can send requests to any port of this machine, and so can every program of
every user on it. So the server listens on 127.0.0.1 alone; its address holds a random secret; a
request must name this server as its host, which keeps out a foreign name that was pointed at this
machine (DNS rebinding), and whatever a page sends must come from a page of this server. All else is
answered 403.

The server is Tornado's: one package without others behind it, long kept and in wide use (Jupyter
stands on it), with limits on the size of headers and bodies and on the time that they take, and
with streams and web sockets for pages that need them. Waitress has no web sockets; Starlette with
Uvicorn brings four packages and no limit on how slowly a request may come; Python's own
http.server, its documentation says, is not recommended for use where security matters.
"""

from __future__ import annotations

import asyncio
import hmac
import logging
import re
import secrets
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler

from pianomime.closing import Closing
from pianomime.errors import InputError

_ANY, _NAME = re.escape("{}"), "([-.\\w]+)"
_HOST = "127.0.0.1"
_LAST_PORT = 65535
_USUAL_PORT = 80
_SECRET_BYTES = 16
_LARGEST_HEADERS = 16_384
"""[bytes]"""
_LARGEST_BODY = 100_000
"""[bytes]"""
_DOOR = ".pianomime-open-"
"""Begin of the names of files that lead a browser to a server."""
_SANDBOXED = "null"
"""What browsers call the origin of a page that has none."""
_PATIENCE = 10.0
"""[s] The longest that the headers of a request may take, and then its body."""

# Tornado's messages on odd requests are for those who set up logging.
logging.getLogger("tornado").addHandler(logging.NullHandler())


class LocalHandler(RequestHandler):
    """Answers requests for one path, after the checks that every request has to pass.

    A web socket's handler may inherit from this class and Tornado's `WebSocketHandler`.
    """

    for_sandboxed: ClassVar[bool] = False
    """Whether a page of this server that runs in a sandbox, and so has no origin, may read it."""
    closed = False
    """Whether the connection was closed before the answer was complete."""

    def on_connection_close(self) -> None:
        """Take note."""
        self.closed = True

    def set_default_headers(self) -> None:
        """Have the browser load nothing from elsewhere, keep nothing, and show it in no frame."""
        self.clear_header("Server")
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.set_header("Cache-Control", "no-store")
        self.set_header(
            "Content-Security-Policy",
            "default-src 'self'; style-src 'unsafe-inline'; media-src 'self' blob:; "
            "img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; "
            "frame-ancestors 'none'",
        )
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.set_header("Referrer-Policy", "same-origin")
        self.set_header("X-Content-Type-Options", "nosniff")

    def prepare(self) -> None:
        """Check where the request comes from, and whether it knows the secret.

        Raises:
            HTTPError: 403.
        """
        host = self.request.headers.get("Host", "")
        origin = self.request.headers.get("Origin")
        asks = self.request.method == "GET"
        upgrades = "Upgrade" in self.request.headers
        if origin == _SANDBOXED and self.for_sandboxed:
            self.set_header("Access-Control-Allow-Origin", _SANDBOXED)
            origin = None
        if self.for_sandboxed:
            # Sound comes without an origin, and is kept from pages of others by the secret alone.
            self.set_header("Cross-Origin-Resource-Policy", "cross-origin")
        if host not in self.settings["hosts"]:
            raise HTTPError(403, reason="Not the address of this page")
        # A browser says where all comes from but what a page of the same server only asks for.
        if origin != f"http://{host}" and not (origin is None and asks and not upgrades):
            raise HTTPError(403, reason="Not sent by this page")
        given = self.request.path.removeprefix("/").partition("/")[0].encode()
        if not hmac.compare_digest(given, self.settings["secret"].encode()):
            raise HTTPError(403, reason="The address lacks its secret: open all of it")

    def write_error(self, status_code: int, **_: Any) -> None:
        """Answer with one line of text."""
        self.set_header("Connection", "close")
        self.finish(f"{self._reason}\n")

    def log_exception(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Tell of faults of ours in one line, and of odd requests not at all."""
        if not isinstance(error, HTTPError):
            print(f"pianomime: a request failed: {error!r}", file=sys.stderr)


class Content(LocalHandler):
    """Answers with a content that does not change."""

    def initialize(self, kind: str, content: str | bytes) -> None:
        """Take what `LocalServer` was given.

        Args:
            kind: its media type.
            content: what it is.
        """
        self._kind, self._content = kind, content

    def get(self) -> None:
        """Answer."""
        self.set_header("Content-Type", self._kind)
        self.finish(self._content)


class _Nothing(LocalHandler):
    """Answers where there is nothing."""

    def prepare(self) -> None:
        super().prepare()
        raise HTTPError(404)


class LocalServer(Closing):
    """Serves in a thread of its own, many browsers at a time. Use it as a context manager.

    Attributes:
        url: address of the page at "", with the secret.
    """

    def __init__(
        self, handlers: Mapping[str, tuple[type[LocalHandler], Mapping[str, Any]]], port: int = 0
    ) -> None:
        """Begin to serve.

        Args:
            handlers: for each path behind the secret, such as "", "picture.png" or "jobs/{}", the
                class that answers, and the arguments of its `initialize`. What stands where the
                path has {}, letters, digits, dots, hyphens and underscores, its methods are given.
            port: of the server; 0 for any free one.

        Raises:
            InputError: there is no such port, or it is in use or reserved.
        """
        if not 0 <= port <= _LAST_PORT:
            raise InputError(f"a port is a number from 0 to {_LAST_PORT}, not {port}")
        try:
            self._sockets = bind_sockets(port, _HOST)
        except OSError as error:
            raise InputError(f"port {port} cannot be used: {error.strerror or error}") from error
        port = self._sockets[0].getsockname()[1]
        secret = secrets.token_urlsafe(_SECRET_BYTES)
        self.url = f"http://{_HOST}:{port}/{secret}/"
        names = (_HOST, "localhost")
        hosts = [f"{name}:{port}" for name in names]
        if port == _USUAL_PORT:  # Browsers leave it out.
            hosts += names
        rules = [
            (f"/[^/]*/{re.escape(path).replace(_ANY, _NAME)}", kind, dict(given))
            for path, (kind, given) in handlers.items()
        ]
        self._application = Application(
            rules,
            default_handler_class=_Nothing,
            log_function=lambda _: None,
            hosts=hosts,
            secret=secret,
        )
        self._door: Path | None = None
        self._loop = asyncio.new_event_loop()
        self._stop = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="local server", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close all connections, and wait until that is done."""
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()
        if self._door is not None:
            self._door.unlink(missing_ok=True)

    def open_browser(self, folder: Path) -> None:
        """Open the page in the user's browser.

        Everybody at this machine can read command lines, so the browser is given a file that only
        this user can read, and which leads to the address.

        Args:
            folder: for the file, which is removed when the server is closed.

        Raises:
            OSError: the file cannot be written.
        """
        for left in folder.glob(f"{_DOOR}*.html"):  # by one that was killed
            left.unlink(missing_ok=True)
        handle, name = tempfile.mkstemp(".html", _DOOR, folder)
        self._door = Path(name)
        with open(handle, "w", encoding="utf-8") as file:
            file.write(f'<meta charset="utf-8"><meta http-equiv="refresh" content="0; {self.url}">')
        webbrowser.open(self._door.absolute().as_uri())

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        server = HTTPServer(
            self._application,
            idle_connection_timeout=_PATIENCE,
            body_timeout=_PATIENCE,
            max_header_size=_LARGEST_HEADERS,
            max_body_size=_LARGEST_BODY,
        )
        server.add_sockets(self._sockets)
        await self._stop.wait()
        server.stop()
        await server.close_all_connections()
