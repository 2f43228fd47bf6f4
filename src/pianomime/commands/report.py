"""`pianomime report`, and the report that `pianomime play` makes as well."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from rich.table import Table

    from pianomime.evaluation.summary import Row
    from pianomime.players.performance import Performance
    from pianomime.progress import Progress

_SAVED_BY_PLAY = "performance.npz"


@dataclass(frozen=True)
class Report:
    """Show a saved performance: hear, see and score it again, without playing it.

    OUT then holds what `pianomime play` makes: a page to look at and listen to (report.html), the
    metrics (report.json), the performance (performance.npz), and MIDI, WAV and pictures.

    Examples:
      pianomime report out/SONG/performance.npz
      pianomime report out/SONG/performance.npz -o out/shown --video
      pianomime report out/all/songs/SONG-*.npz
    """

    performance: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PERFORMANCE.npz")]
    """A performance that `pianomime play` or `pianomime evaluate` has written."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT", help_behavior_hint="")
    ] = None
    """Folder for the report; by default that of a performance.npz, and for a file of another name a
    folder of that name beside it."""
    video: bool = False
    """Render a film of 60 pictures a second too, where this machine can; one in OUT that is of this
    performance stays without it."""

    def run(self) -> None:
        """Read the performance and write the report.

        Raises:
            InputError: the file is no performance, or damaged.
            OSError: a file cannot be read or written.
        """
        from pianomime.players.performance import Performance

        performance = Performance.load(self.performance)
        make_report(lambda _: performance, self.out or self._beside(), self.video)

    def _beside(self) -> Path:
        from pianomime.file_names import file_name

        path = self.performance
        if path.name == _SAVED_BY_PLAY:
            return path.parent
        return path.parent / file_name(path.stem)


def make_report(perform: Callable[[Progress], Performance], out: Path, video: bool) -> None:
    """Write the report of a performance, and print its metrics and where it is.

    Args:
        perform: makes the performance, when it is known that `out` can be written.
        out: folder for the report.
        video: whether to render a film, where this machine can.

    Raises:
        InputError: what is asked for cannot be performed.
        OSError: a file cannot be read or written.
    """
    from rich.console import Console

    from pianomime.commands.progress import bars
    from pianomime.files import staged
    from pianomime.report import FILES, write_report
    from pianomime.shown import shown

    notes: list[str] = []
    with staged(out, FILES) as folder, bars() as progress:
        row = write_report(
            perform(progress), folder, video, progress=progress, note=notes.append, earlier=out
        )
    Console().print(_table(row))
    for note in notes:
        print(shown(note))
    print(f"look and listen: {shown(out / 'report.html')}")


def _table(row: Row) -> Table:
    from rich.table import Table
    from rich.text import Text

    from pianomime.evaluation.measures import BODY, FRAMES, MUSIC

    # A Text, not a str, in which rich would look for markup.
    table = Table(title=Text(str(row["song"])), title_style="bold", show_header=False)
    for measure in (*MUSIC, *FRAMES, *BODY):
        # Units stand in brackets, which rich takes for markup.
        table.add_row(Text(measure.label), measure.show(row))
    for label, text in (
        ("notes (left out)", f"{row['notes']} ({row['dropped_notes']})"),
        ("physics broke", f"{row['blow_ups']} times"),
        (
            "planned, simulated",
            f"{row['plan_seconds']:.1f} s, {row['simulate_seconds']:.1f} s "
            f"for {row['song_seconds']:.1f} s of music",
        ),
    ):
        table.add_row(label, text)
    return table
