"""`pianomime explain`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from rich.table import Table

    from pianomime.explain import Explanation

_LONGEST = 10


@dataclass(frozen=True)
class Explain:
    """Say why notes of a performance were missed or wrong: by which cause, by which finger.

    OUT then also holds the same as a picture (explanation.png) and every single fault
    (explanation.json). Several performances are added up.

    Examples:
      pianomime explain out/fur-elise/performance.npz
      pianomime explain out/fur-elise/performance.npz -o out/why
      pianomime explain out/*/performance.npz -o out/why
    """

    performances: Annotated[
        tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="PERFORMANCE.npz...")
    ]
    """What `pianomime play` saved as performance.npz."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = None
    """Folder for the explanation; that of the first performance if not given."""

    def run(self) -> None:
        """Explain, print and write.

        Raises:
            InputError: there is no performance, or one without a plan to compare with.
            OSError: a file cannot be read or written.
        """
        from rich.console import Console

        from pianomime.errors import InputError
        from pianomime.performance import Performance
        from pianomime.report import EXPLANATION_FILES, staged, write_explanation

        if not self.performances:
            raise InputError("no performance to explain")
        loaded = [Performance.load(path) for path in self.performances]
        for path, performance in zip(self.performances, loaded, strict=True):
            if performance.plan is None:
                raise InputError(f"{path}: {performance.player} played it without a fingertip plan")
        out = self.out or self.performances[0].parent
        with staged(out, EXPLANATION_FILES) as folder:
            explanations = write_explanation(loaded, folder)
        console = Console()
        console.print(_causes(explanations))
        if any(explanation.faults for explanation in explanations):
            console.print(_longest(explanations))
        print(f"look: {out / 'explanation.png'}")


def _causes(explanations: Sequence[Explanation]) -> Table:
    from rich.table import Table

    from pianomime.explain import totals

    songs = explanations[0].song if len(explanations) == 1 else f"{len(explanations)} songs"
    table = Table(
        title=songs,
        title_style="bold",
        caption="frames of 0.05 s; their share of those in which keys should be down",
    )
    table.add_column("cause", no_wrap=True)
    table.add_column("")
    for label in ("frames", "share", "notes"):
        table.add_column(label, justify="right")
    table.add_column("worst finger", no_wrap=True)
    for total in totals(explanations):
        table.add_row(
            total.cause,
            "missed" if total.missed else "wrong",
            str(total.frames),
            f"{total.share:.1%}",
            str(total.notes),
            _finger(total.hand, total.finger),
        )
    return table


def _longest(explanations: Sequence[Explanation]) -> Table:
    from rich.table import Table

    from pianomime.performance import FRAMES_A_SECOND
    from pianomime.report import key_name

    several = len(explanations) > 1
    table = Table(title="longest faults [s]", title_style="bold")
    if several:
        table.add_column("song", overflow="ellipsis", no_wrap=True, max_width=12)
    for label in ("at", "for"):
        table.add_column(label, justify="right", no_wrap=True)
    for label in ("key", "cause", "finger"):
        table.add_column(label, no_wrap=True)
    faults = [(made.song, fault) for made in explanations for fault in made.faults]
    for song, fault in sorted(faults, key=lambda item: -item[1].frames)[:_LONGEST]:
        table.add_row(
            *([song] if several else []),
            f"{fault.first / FRAMES_A_SECOND:.2f}",
            f"{fault.frames / FRAMES_A_SECOND:.2f}",
            key_name(fault.key),
            fault.cause,
            _finger(fault.hand, fault.finger),
        )
    return table


def _finger(hand: int, finger: int) -> str:
    from pianomime.plan.fingertip_plan import FINGERS

    return "-" if hand < 0 else f"{('left', 'right')[hand]} {FINGERS[finger]}"
