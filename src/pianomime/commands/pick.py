"""`pianomime pick`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Pick:
    """Mark the keyboard in a video by clicking points of it on a web page of this machine.

    For videos in which `pianomime retarget` does not find the keyboard. Four points are enough;
    eight are better.

    Examples:
      pianomime pick VIDEO.mp4 -o POINTS.json
      pianomime retarget VIDEO.mp4 --points POINTS.json
    """

    video: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="VIDEO")]
    """A video of a keyboard from above."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="POINTS.json", help_behavior_hint="")
    ] = None
    """File for the points; by default out/VIDEO-points.json."""
    port: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Port of the web page; 0 for any free one."""
    browser: bool = True
    """Open the page in a browser."""

    def run(self) -> None:
        """Serve the page until the points are saved.

        Raises:
            InputError: the video cannot be read, OUT is not a .json file, or the port is in use.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.errors import InputError
        from pianomime.file_names import file_name
        from pianomime.shown import command_word, shown
        from pianomime.video.film.film import Film

        with extra("video"):
            from pianomime.video.keyboard.clear_picture import clear_picture
            from pianomime.video.keyboard.pick_page import PickPage

        out = self.out or Path("out", file_name(self.video.stem) + "-points.json")
        if out.suffix != ".json":
            raise InputError(f"{out}: the name of a file of points must end in .json")
        film = Film(self.video)
        picture, second = clear_picture(film)
        with PickPage(film, picture, out, self.port) as page:
            out.parent.mkdir(parents=True, exist_ok=True)
            if second is not None:
                print(
                    "note: the camera moves, or the video is cut: the page shows the picture at "
                    f"{second:.2f} s, and the points hold for that place alone; `pianomime "
                    "retarget` follows the keyboard where --points is not given"
                )
            print(f"click the points on {page.url} (Ctrl-C to cancel)", flush=True)
            if self.browser:
                page.open_browser()
            saved = page.wait()
        print(f"saved {shown(out)}: {shown(saved)}")
        print(f"next: pianomime retarget {command_word(self.video)} --points {command_word(out)}")
