"""`pianomime export`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from rich.table import Table

    from pianomime.export.limits import Breach

_MOST_SHOWN = 10
"""Broken limits that are shown; broken.csv has all."""


@dataclass(frozen=True)
class Export:
    """Write a performance for a real pair of hands: joint trajectories, limits and the world.

    OUT then holds positions, velocities, efforts and commands (CSV), the same as messages of ROS 2
    (MCAP), what the keys sensed (CSV, MIDI), the limits and what breaks them (CSV), and the world
    as it was played in (MJCF, URDF). The performance is played again for it.

    Examples:
      pianomime export out/SONG/performance.npz
      pianomime export out/SONG/performance.npz --rate 500 -o out/robot
      pianomime export out/SONG/performance.npz --limits ROBOT.csv --strict
    """

    performance: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PERFORMANCE.npz")]
    """A performance that `pianomime play` or `pianomime evaluate` has written."""
    rate: Annotated[int, tyro.conf.arg(metavar="HZ")] = 100
    """Samples in a second, 1 to 1000. The physics has 200 steps in a second; what is between them
    is interpolated."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT", help_behavior_hint="")
    ] = None
    """Folder for the files; by default NAME-export beside NAME.npz."""
    limits: Annotated[Path | None, tyro.conf.arg(metavar="LIMITS.csv", help_behavior_hint="")] = (
        None
    )
    """Limits of your robot: a limits.csv of an export, in which you changed numbers. By default the
    limits of the world, and the speeds that Shadow Robot gives for its hand: 4 rad/s at the thumb's
    base, 2 rad/s elsewhere."""
    strict: bool = False
    """Write nothing if a limit is broken."""

    def run(self) -> None:
        """Export, and print what breaks a limit.

        Raises:
            InputError: a file is of another kind or damaged, the performance cannot be played
                again, or it breaks a limit and `strict` is set.
            OSError: a file cannot be read or written.
        """
        from rich.console import Console

        from pianomime.commands.progress import bars
        from pianomime.errors import InputError
        from pianomime.export import FILES, Limits, read_limits, write_export
        from pianomime.file_names import file_name
        from pianomime.files import staged
        from pianomime.players.performance import Performance
        from pianomime.progress import telling
        from pianomime.shown import shown
        from pianomime.world.model import world_model

        performance = Performance.load(self.performance)
        limits = Limits.of(world_model(performance.world))
        if self.limits is not None:
            limits = read_limits(self.limits, limits)
        out = self.out or self.performance.parent / file_name(f"{self.performance.stem}-export")
        notes: list[str] = []
        with staged(out, FILES) as folder, bars() as progress, telling(progress):
            breaches = write_export(performance, folder, self.rate, notes.append, limits)
            if breaches and self.strict:
                worst = _by_steps(breaches)[0]
                raise InputError(
                    f"{len(breaches)} limits are broken, most often the {worst.kind} of "
                    f"{worst.name}: in {worst.share:.1%} of the time, {_size(worst.worst)} "
                    f"{worst.unit} where {_size(worst.limit)} is the limit at {worst.at:.3f} s"
                )
        if breaches:
            Console().print(_table(breaches))
        else:
            print("all limits are kept")
        for note in notes:
            print(shown(note))
        print(f"for a robot: {shown(out)}")


def _by_steps(breaches: Sequence[Breach]) -> list[Breach]:
    return sorted(breaches, key=lambda breach: -breach.steps)


def _table(breaches: Sequence[Breach]) -> Table:
    from rich.table import Table

    shown = _by_steps(breaches)[:_MOST_SHOWN]
    table = Table(
        title="limits that are broken",
        title_style="bold",
        caption=f"the {len(shown)} most often broken of {len(breaches)}; broken.csv has all",
    )
    for label in ("name", "of"):
        table.add_column(label, no_wrap=True)
    for label in ("limit", "worst", "at [s]", "of the time"):
        table.add_column(label, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for each in shown:
        table.add_row(
            each.name,
            each.kind,
            _size(each.limit),
            _size(each.worst),
            f"{each.at:.3f}",
            f"{each.share:.1%}",
            each.unit,
        )
    return table


def _size(value: float) -> str:
    return f"{value:.4g}"
