"""The table of limits: written of the world, and read again when it was edited for a robot."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pianomime.errors import InputError
from pianomime.export.csv_table import number_text, write_table
from pianomime.export.limits import Limits

_HEADER = ("of", "name", "unit", "lower", "upper", "velocity [unit/s]", "effort [N m or N]")
_NOT_OF = {"joint": (6, "actuator"), "actuator": (5, "joint")}
"""The column that has no limit of a joint, or of an actuator, and what has one there."""
_LARGEST_FILE = 1_000_000
"""[bytes] A hundred times what such a table has."""


def write_limits(limits: Limits, path: Path) -> None:
    """Write the limits of joints, and below them those of actuators; no limit is an empty cell.

    Positions and velocities are limited of joints, targets and efforts of actuators.

    Args:
        limits: to be written.
        path: of the table.
    """
    write_table(path, _HEADER, _rows(limits))


def read_limits(path: Path, known: Limits) -> Limits:
    """Read a table of limits, such as `write_limits` writes, with other numbers in it.

    Args:
        path: of the table.
        known: limits of the same joints and actuators.

    Raises:
        InputError: the file is no such table, it is of others, a limit is no number, leaves
            nothing between lower and upper, or is one of effort of a joint, or of velocity of an
            actuator.
        OSError: it cannot be read.
    """
    if path.stat().st_size > _LARGEST_FILE:
        raise InputError(f"{path}: is no table of limits: it is too large")
    try:
        header, *rows = csv.reader(path.read_text("utf-8-sig").splitlines())
    except (UnicodeDecodeError, csv.Error, ValueError):
        raise InputError(f"{path}: is no table of limits") from None
    wanted = list(_rows(known))
    if tuple(header) != _HEADER or [row[:3] for row in rows] != [[*row[:3]] for row in wanted]:
        raise InputError(
            f"{path}: is no table of limits of these hands: edit the numbers alone of a limits.csv"
        )
    # Spreadsheets may leave out empty cells at the end of a row.
    rows = [row + [""] * (len(_HEADER) - len(row)) for row in rows]
    for row in rows:
        column, owner = _NOT_OF[row[0]]
        if row[column].strip():
            raise InputError(
                f"{path}: the {row[0]} {row[1]} has no {_HEADER[column].split()[0]} of its own: "
                f"limit that of the {owner}"
            )
    number = np.array([[_number(path, row, column) for column in range(3, 7)] for row in rows])
    lower, upper = np.where(np.isnan(number[:, 0]), -np.inf, number[:, 0]), _or_inf(number[:, 1])
    velocity, effort = _or_inf(number[:, 2]), _or_inf(number[:, 3])
    for row, below, above, fastest, most in zip(rows, lower, upper, velocity, effort, strict=True):
        if below >= above or fastest <= 0 or most <= 0:
            raise InputError(f"{path}: the limits of {row[1]} leave nothing that it may do")
    joints = len(known.joints.names)
    return replace(
        known,
        lower=lower[:joints],
        upper=upper[:joints],
        velocity=velocity[:joints],
        effort=effort[joints:],
        low=lower[joints:],
        high=upper[joints:],
    )


def _rows(limits: Limits) -> Iterator[tuple[str, ...]]:
    joints = limits.joints
    named = zip(joints.names, joints.units, strict=True)
    for (name, unit), *numbers in zip(
        named, limits.lower, limits.upper, limits.velocity, strict=True
    ):
        yield ("joint", name, unit, *map(number_text, numbers), "")
    named = zip(joints.actuators, joints.actuator_units, strict=True)
    for (name, unit), low, high, most in zip(
        named, limits.low, limits.high, limits.effort, strict=True
    ):
        yield ("actuator", name, unit, number_text(low), number_text(high), "", number_text(most))


def _number(path: Path, row: list[str], column: int) -> float:
    """A cell, NaN if it is empty."""
    cell = row[column].strip()
    try:
        number = float(cell or "nan")
    except ValueError:
        raise InputError(f"{path}: a limit of {row[1]} is not a number") from None
    if cell and not math.isfinite(number):
        raise InputError(f"{path}: a limit of {row[1]} is not a finite number; leave it empty")
    return number


def _or_inf(numbers: np.ndarray) -> np.ndarray:
    unlimited: np.ndarray = np.where(np.isnan(numbers), np.inf, numbers)
    return unlimited
