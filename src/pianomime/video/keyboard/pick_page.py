"""Web page, served to this machine only, on which a person clicks points of the keyboard."""

from __future__ import annotations

import io
import json
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from string import Template
from types import TracebackType
from typing import Any

import numpy as np
from PIL import Image

from pianomime.errors import InputError
from pianomime.files import atomic
from pianomime.video.film.film import Film
from pianomime.video.keyboard.points import SUGGESTED, parse_points

_FRAMES = 15
"""Pictures whose median the page shows."""
_LAST_PORT = 65535
_LONGEST = 100_000
"""[bytes] Largest request."""
_TIMEOUT = 2.0
"""[s] Longest silence of a browser that has connected; other requests wait so long."""

_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Where is the keyboard?</title><style>
:root { color-scheme: light dark; font-family: system-ui, sans-serif; }
body { margin: 1rem; } #frame { position: relative; width: 100%; cursor: crosshair; }
#frame img { width: 100%; display: block; }
#frame span { position: absolute; width: 9px; height: 9px; margin: -5px; border-radius: 50%;
  border: 2px solid #f33; pointer-events: none; }
li.now { font-weight: bold; } li.done { opacity: .6; } button { font: inherit; }
#message { min-height: 1.5em; }
</style></head><body>
<p>Click the point in bold, or skip it if it is not visible. Front is toward the player, left is the
bass. At least four points are needed.</p>
<div id="frame"><img src="frame.png" alt="the video"></div>
<ol id="names"></ol>
<p><button id="skip">Skip</button> <button id="undo">Undo</button>
<button id="save">Save</button></p><p id="message"></p>
<script>
const names = $names, width = $width, height = $height;
let points = {}, order = [], now = 0;
const frame = document.getElementById("frame"), message = document.getElementById("message");
function show() {
  document.getElementById("names").innerHTML = names.map((name, i) =>
    `<li class="$${i == now ? "now" : i < now ? "done" : ""}">$${name}` +
    (points[name] ? ` ($${points[name].map(Math.round)})` : "") + "</li>").join("");
  frame.querySelectorAll("span").forEach(mark => mark.remove());
  for (const name in points) {
    const mark = document.createElement("span");
    mark.style.left = 100 * points[name][0] / width + "%";
    mark.style.top = 100 * points[name][1] / height + "%";
    mark.title = name; frame.append(mark);
  }
}
frame.onclick = event => {
  if (now >= names.length) return;
  const box = frame.getBoundingClientRect();
  points[names[now]] = [(event.clientX - box.left) / box.width * width,
                        (event.clientY - box.top) / box.height * height];
  now++; show();
};
document.getElementById("skip").onclick = () => { now = Math.min(now + 1, names.length); show(); };
document.getElementById("undo").onclick = () => {
  now = Math.max(now - 1, 0); delete points[names[now]]; show(); };
document.getElementById("save").onclick = async () => {
  const answer = await fetch("points", {method: "POST", body: JSON.stringify({points})});
  message.textContent = await answer.text();
};
show();
</script></body></html>
""")


class PickPage:
    """Serves the page. Use it as a context manager.

    Attributes:
        url: address of the page.
        saved: how well the saved points fit, in one line; empty until some are saved.
    """

    def __init__(self, film: Film, out: Path, port: int = 0) -> None:
        """Start the server.

        Args:
            film: the video.
            out: JSON file to write, see `pianomime.video.keyboard.points`.
            port: port of the server; 0 for any free one.

        Raises:
            InputError: there is no such port, or no picture in the video can be read.
            OSError: the port is in use.
        """
        if not 0 <= port <= _LAST_PORT:
            raise InputError(f"a port is a number from 0 to {_LAST_PORT}, not {port}")
        pictures = film.sample(_FRAMES)
        if not pictures:
            raise InputError(f"{film.path}: no picture in it can be read")
        # The median removes most of the hands.
        picture = np.median(np.stack(pictures), axis=0).astype(np.uint8)
        file = io.BytesIO()
        Image.fromarray(picture).save(file, "png")
        page = _PAGE.substitute(names=json.dumps(SUGGESTED), width=film.width, height=film.height)
        self.saved = ""
        contents = {"/": ("text/html", page.encode()), "/frame.png": ("image/png", file.getvalue())}
        owner = self

        class Handler(BaseHTTPRequestHandler):
            timeout = _TIMEOUT

            def do_GET(self) -> None:
                if self.path in contents:
                    self._answer(200, *contents[self.path])
                else:
                    self._answer(404, "text/plain", b"nothing here")

            def do_POST(self) -> None:
                length = int(self.headers.get("Content-Length", 0))
                if self.path != "/points" or not 0 < length <= _LONGEST:
                    self._answer(404, "text/plain", b"nothing here")
                    return
                try:
                    saved = _save(self.rfile.read(length), out)
                except InputError as error:
                    self._answer(400, "text/plain", str(error).encode())
                    return
                self._answer(200, "text/plain", f"Saved: {saved}. You can close this.".encode())
                owner.saved = saved

            def _answer(self, code: int, kind: str, content: bytes) -> None:
                self.send_response(code)
                self.send_header("Content-Type", f"{kind}; charset=utf-8")
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, format: str, *args: Any) -> None:
                """Keep the terminal clean."""

        self._server = HTTPServer(("127.0.0.1", port), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}/"

    def __enter__(self) -> PickPage:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._server.server_close()

    def wait(self) -> str:
        """Answer requests until points are saved that determine where the keyboard is.

        Returns:
            How well they fit, in one line.
        """
        while not self.saved:
            self._server.handle_request()
        return self.saved


def _save(answer: bytes, out: Path) -> str:
    """Check and write the points that a browser has sent."""
    try:
        text = json.dumps(json.loads(answer), indent=2) + "\n"
    except ValueError as error:
        raise InputError("the points did not arrive as JSON") from error
    saved = parse_points(text, out).describe()
    with atomic(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return saved
