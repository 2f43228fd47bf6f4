"""`pianomime diagnose`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from rich.table import Table

    from pianomime.evaluation.diagnose import Diagnosis

_LONGEST = 10


@dataclass(frozen=True)
class Diagnose:
    """Find out why keys were missed or wrong in a performance: the cause, and the finger.

    Prints the causes, and writes a picture (diagnosis.png) and all faults (diagnosis.json) to OUT.
    Several performances are summed.

    Examples:
      pianomime diagnose out/SONG/performance.npz
      pianomime diagnose out/SONG/performance.npz -o out/why
      pianomime diagnose out/*/performance.npz -o out/why
    """

    performances: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="PERFORMANCE.npz...", help_behavior_hint="(required)"),
    ]
    """Performances that `pianomime play` (performance.npz) or `pianomime evaluate`
    (songs/SONG-*.npz) has written."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT", help_behavior_hint="")
    ] = None
    """Folder for the diagnosis; by default that of the first performance."""

    def run(self) -> None:
        """Diagnose, print and write.

        Raises:
            InputError: no performance is given, or one has no fingertip plan.
            OSError: a file cannot be read or written.
        """
        from rich.console import Console

        from pianomime.errors import InputError
        from pianomime.files import staged
        from pianomime.players.performance import Performance
        from pianomime.report import DIAGNOSIS_FILES, write_diagnosis
        from pianomime.shown import shown

        if not self.performances:
            raise InputError("no performance to diagnose")
        loaded = [Performance.load(path) for path in self.performances]
        for path, performance in zip(self.performances, loaded, strict=True):
            if performance.plan is None:
                raise InputError(f"{path}: {performance.player} played it without a fingertip plan")
        out = self.out or self.performances[0].parent
        with staged(out, DIAGNOSIS_FILES) as folder:
            diagnoses = write_diagnosis(loaded, folder)
        console = Console()
        console.print(_causes(diagnoses))
        if any(diagnosis.faults for diagnosis in diagnoses):
            console.print(_longest(diagnoses))
        print(f"picture: {shown(out / 'diagnosis.png')}")


def _causes(diagnoses: Sequence[Diagnosis]) -> Table:
    from rich.table import Table
    from rich.text import Text

    from pianomime.evaluation.diagnose import totals

    # A Text, not a str, in which rich would look for markup.
    songs = diagnoses[0].song if len(diagnoses) == 1 else f"{len(diagnoses)} songs"
    table = Table(
        title=Text(songs),
        title_style="bold",
        caption="frames: one key for 0.05 s; share: of all frames in which keys should be down",
    )
    table.add_column("cause", no_wrap=True)
    table.add_column("")
    for label in ("frames", "share", "notes"):
        table.add_column(label, justify="right")
    table.add_column("worst finger", no_wrap=True)
    for total in totals(diagnoses):
        table.add_row(
            total.cause,
            "missed" if total.missed else "wrong",
            str(total.frames),
            f"{total.share:.1%}",
            str(total.notes),
            _finger(total.hand, total.finger),
        )
    return table


def _longest(diagnoses: Sequence[Diagnosis]) -> Table:
    from rich.table import Table
    from rich.text import Text

    from pianomime.keyboard import FRAME_RATE, key_name

    several = len(diagnoses) > 1
    table = Table(title="longest faults [s]", title_style="bold")
    if several:
        table.add_column("song", overflow="ellipsis", no_wrap=True, max_width=12)
    for label in ("at", "for"):
        table.add_column(label, justify="right", no_wrap=True)
    for label in ("key", "cause", "finger"):
        table.add_column(label, no_wrap=True)
    faults = [(made.song, fault) for made in diagnoses for fault in made.faults]
    for song, fault in sorted(faults, key=lambda item: -item[1].frames)[:_LONGEST]:
        table.add_row(
            *([Text(song)] if several else []),
            f"{fault.first / FRAME_RATE:.2f}",
            f"{fault.frames / FRAME_RATE:.2f}",
            key_name(fault.key),
            fault.cause,
            _finger(fault.hand, fault.finger),
        )
    return table


def _finger(hand: int, finger: int) -> str:
    from pianomime.plan.fingertip_plan import FINGERS

    return "-" if hand < 0 else f"{('left', 'right')[hand]} {FINGERS[finger]}"
