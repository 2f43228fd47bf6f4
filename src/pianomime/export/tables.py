"""Tables of a trajectory, of key events and of broken limits, with units in their first rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pianomime.export.csv_table import DIGITS, number_text, write_table
from pianomime.export.joints import Joints, effort_unit
from pianomime.export.limits import Breach
from pianomime.export.samples import Samples
from pianomime.keyboard import LOWEST_PITCH, key_name
from pianomime.players.performance import Performance

TRAJECTORY_FILES = ("positions.csv", "velocities.csv", "efforts.csv", "commands.csv")
"""The tables of a trajectory."""


@contextmanager
def trajectory_tables(folder: Path, joints: Joints) -> Iterator[Callable[[Samples], None]]:
    """Write the tables of a trajectory as it goes on: yields what writes its next samples.

    Positions and velocities have J0 as well, the sum of the coupled joints J1 and J2 of a finger.

    Args:
        folder: for the tables, `TRAJECTORY_FILES`.
        joints: whose trajectory it is.
    """
    pairs = [list(pair) for pair in joints.coupled.values()]
    actuators = list(zip(joints.actuators, joints.actuator_units, strict=True))
    named = list(zip(joints.names, joints.units, strict=True))
    summed = [*named, *(actuators[index] for index in joints.coupled)]
    headers = (
        [f"{name} [{unit}]" for name, unit in summed],
        [f"{name} [{unit}/s]" for name, unit in summed],
        [f"{name} [{effort_unit(unit)}]" for name, unit in named],
        [f"{name} [{unit}]" for name, unit in actuators],
    )

    def with_sums(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack([values, *(values[:, pair].sum(axis=1) for pair in pairs)])

    def write(block: Samples) -> None:
        position, velocity = with_sums(block.position), with_sums(block.velocity)
        tables = (position, velocity, block.effort, block.command)
        for file, values in zip(files, tables, strict=True):
            np.savetxt(file, np.column_stack([block.time, values]), DIGITS, ",")

    with ExitStack() as stack:
        files = [
            stack.enter_context((folder / name).open("w", encoding="utf-8", newline="\n"))
            for name in TRAJECTORY_FILES
        ]
        for file, header in zip(files, headers, strict=True):
            print("time [s]", *header, sep=",", file=file)
        yield write


def write_key_events(performance: Performance, path: Path) -> None:
    """Write when each key sounded and how fast it went down.

    Args:
        performance: of whose keys.
        path: of the table.
    """
    rows = zip(
        performance.event_key.tolist(),
        performance.event_on.tolist(),
        performance.event_off.tolist(),
        performance.event_speed.tolist(),
        performance.event_velocity.tolist(),
        strict=True,
    )
    header = ("key", "pitch", "on [s]", "off [s]", "speed [m/s]", "MIDI velocity")
    write_table(
        path,
        header,
        (
            (key_name(key), LOWEST_PITCH + key, *map(number_text, (on, off, speed)), velocity)
            for key, on, off, speed, velocity in rows
        ),
    )


def write_pedal(performance: Performance, path: Path) -> None:
    """Write when the sustain pedal was down.

    Args:
        performance: of whose pedal.
        path: of the table.
    """
    rows = (map(number_text, times) for times in performance.pedal_times.tolist())
    write_table(path, ("down [s]", "up [s]"), rows)


def write_breaches(breaches: Sequence[Breach], path: Path) -> None:
    """Write what broke a limit; nothing but the names of the columns if all were kept.

    Args:
        breaches: to be written.
        path: of the table.
    """
    header = ("name", "kind", "unit", "limit", "worst", "at [s]", "physics steps", "share of steps")
    rows = (
        (
            each.name,
            each.kind,
            each.unit,
            *map(number_text, (each.limit, each.worst, each.at)),
            each.steps,
            number_text(each.share),
        )
        for each in breaches
    )
    write_table(path, header, rows)
