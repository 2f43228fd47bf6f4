"""`pianomime stage`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class StageCommand:
    """Watch songs being played, in 3D in the browser: drop a MIDI file, and two hands play it.

    The page is served to this machine alone, at an address that holds a secret. It shows the
    bundled songs and those given, and performances that were saved; two of them can be compared
    side by side. What is played there is kept in OUT as `pianomime play` would keep it.

    Examples:
      pianomime stage
      pianomime stage SONG.mid FOLDER
      pianomime stage out/SONG out/all
      pianomime stage --port 8080 --no-browser
    """

    given: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="[SONGS or RESULTS...]", help_behavior_hint=""),
    ] = ()
    """MIDI files and folders of them, and folders that `pianomime play` or `pianomime evaluate`
    wrote."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/stage")
    """Folder for what is played and for files that are dropped."""
    port: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Port of the page; 0 for any free one."""
    browser: bool = True
    """Open the page in a browser."""

    def run(self) -> None:
        """Serve the page until Ctrl-C.

        Raises:
            InputError: something given is neither song nor result, the page is not built, or the
                port is in use.
            OSError: OUT cannot be written.
        """
        import threading

        from pianomime.commands.extras import extra

        with extra("stage"):
            from pianomime.stage.server import Stage

        with Stage(self.out, self.given, self.port) as stage:
            print(f"the stage is at {stage.url} (Ctrl-C to end)", flush=True)
            if self.browser:
                stage.open_browser()
            threading.Event().wait()
