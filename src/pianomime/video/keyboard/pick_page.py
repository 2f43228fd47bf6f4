"""Web page, served to this machine only, on which a person clicks points of the keyboard."""

from __future__ import annotations

import asyncio
import io
import json
import queue
from collections.abc import Callable
from html import escape
from importlib import resources
from pathlib import Path
from string import Template

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pianomime.closing import Closing
from pianomime.errors import InputError
from pianomime.files import atomic
from pianomime.local_server import Content, LocalHandler, LocalServer
from pianomime.video.film.film import Film
from pianomime.video.keyboard.points import SUGGESTED, parse_points
from pianomime.web_page import web_page

_STYLE = """\
#frame { position: relative; cursor: crosshair; }
#frame span { position: absolute; width: 14px; height: 14px; margin: -7px; border-radius: 50%;
  border: 2px solid #fff; background: var(--right); pointer-events: none; }
#names { columns: 14rem; margin: 0; }
li.now { font-weight: bold; } li.done { color: var(--faint); }
button { font: inherit; padding: .3rem 1rem; }
#message { min-height: 1.5em; margin: .5rem 0 0; }
"""
_BODY = Template("""\
<h1>Where is the keyboard?</h1>
<p class="under">Click the point in bold, or skip it if it is not visible. Front is toward the
player, left is the bass. At least four points are needed.</p>
<section>
<div id="frame" data-names="$names" data-width="$width" data-height="$height">
<img src="frame.png" alt="the video"></div>
</section>
<section><ol id="names"></ol></section>
<section>
<button id="skip">Skip</button> <button id="undo">Undo</button> <button id="save">Save</button>
<p id="message"></p>
</section>
<script src="pick_page.js"></script>
""")


class _Points(LocalHandler):
    """Saves the points that the page sends."""

    def initialize(self, save: Callable[[bytes], str], done: Callable[[str], None]) -> None:
        self._save, self._done = save, done

    async def post(self) -> None:
        if self.request.headers.get("Content-Type") != "application/json":
            self.send_error(415, reason="Points come as JSON")
            return
        try:
            # In another thread, so that other requests are answered meanwhile.
            saved = await asyncio.to_thread(self._save, self.request.body)
        except InputError as error:
            self.set_status(400)
            self.finish(str(error))
            return
        except OSError as error:
            self.set_status(500)
            self.finish(f"The points cannot be saved: {error}")
            return
        try:
            await self.finish(f"Saved: {saved}. You can close this.")
        finally:
            self._done(saved)


class PickPage(Closing):
    """Serves the page. Use it as a context manager.

    Attributes:
        url: address of the page, which holds a secret.
    """

    def __init__(self, film: Film, picture: NDArray[np.uint8], out: Path, port: int = 0) -> None:
        """Begin to serve.

        Args:
            film: the video.
            picture: (height, width, 3) uint8, what the page shows of it, see `clear_picture`.
            out: JSON file to write, see `pianomime.video.keyboard.points`.
            port: port of the server; 0 for any free one.

        Raises:
            InputError: there is no such port, or it is in use.
        """
        file = io.BytesIO()
        Image.fromarray(picture).save(file, "png")
        body = _BODY.substitute(
            names=escape(json.dumps(SUGGESTED)), width=film.width, height=film.height
        )
        html = web_page("Where is the keyboard? - PianoMime", body, _STYLE).encode()
        script = resources.files(__package__).joinpath("pick_page.js").read_bytes()
        # SimpleQueue, because waiting for it can be interrupted by Ctrl-C.
        self._saved: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._server = LocalServer(
            {
                "": (Content, {"kind": "text/html; charset=utf-8", "content": html}),
                "frame.png": (Content, {"kind": "image/png", "content": file.getvalue()}),
                "pick_page.js": (
                    Content,
                    {"kind": "text/javascript; charset=utf-8", "content": script},
                ),
                "points": (
                    _Points,
                    {"save": lambda answer: _save(answer, out), "done": self._saved.put},
                ),
            },
            port,
        )
        self.url = self._server.url
        self._folder = out.parent

    def close(self) -> None:
        """Close it."""
        self._server.close()

    def open_browser(self) -> None:
        """Open the page in the user's browser, see `LocalServer.open_browser`."""
        self._server.open_browser(self._folder)

    def wait(self) -> str:
        """Wait until points are saved that determine where the keyboard is.

        Returns:
            How well they fit, in one line.
        """
        return self._saved.get()


def _save(answer: bytes, out: Path) -> str:
    """Check and write the points that a browser has sent."""
    try:
        text = answer.decode()
    except UnicodeDecodeError as error:
        raise InputError("the points did not arrive as JSON") from error
    saved = parse_points(text, out).describe()
    with atomic(out) as temporary:
        # Only what was checked.
        points = {"points": json.loads(text)["points"]}
        temporary.write_text(json.dumps(points, indent=2) + "\n", encoding="utf-8")
    return saved
