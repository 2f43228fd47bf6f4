"""`pianomime pick`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Pick:
    """Show where the keyboard is, by clicking points of it in a web page on this machine.

    For videos in which `pianomime retarget` does not find it by itself. Four points will do; eight
    are better.

    Examples:
      pianomime pick VIDEO.mp4 -o POINTS.json
      pianomime retarget VIDEO.mp4 --points POINTS.json
    """

    video: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="VIDEO")]
    """Any video in which a keyboard is seen from above."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="POINTS.json")] = None
    """The points; out/VIDEO-points.json if not given."""
    port: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Of the web page; any free one if 0."""
    browser: bool = True
    """Open the page in a browser."""

    def run(self) -> None:
        """Serve the page until the points are saved.

        Raises:
            InputError: not a video, or OUT or the port is not what it should be.
            OSError: a file cannot be read or written.
        """
        import webbrowser

        from pianomime.errors import InputError
        from pianomime.video.film.film import Film
        from pianomime.video.keyboard.pick_page import PickPage

        out = self.out or Path("out", self.video.stem + "-points.json")
        if out.suffix != ".json":
            raise InputError(f"{out}: points are a file that ends in .json")
        with PickPage(Film(self.video), out, self.port) as page:
            out.parent.mkdir(parents=True, exist_ok=True)
            print(f"click the points here: {page.url} (Ctrl-C to give up)", flush=True)
            if self.browser:
                webbrowser.open(page.url)
            told = page.wait()
        print(f"saved {out}: {told}")
        print(f"go on with: pianomime retarget {self.video} --points {out}")
