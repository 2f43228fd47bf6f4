"""Checks of settings, for the `__post_init__` of configs."""

from __future__ import annotations

import dataclasses
import math
import typing
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from pianomime.errors import InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_MOST_LAYERS, _WIDEST = 8, 8192
"""Of a network: what a damaged file asks for must not fill the memory."""
_ROUNDING = 1e-6
"""Share of a unit by which its multiple may be off, as 3 * 0.005 is from 0.015."""


def within(name: str, value: float, least: float, most: float = math.inf) -> None:
    """Refuse a number out of range, infinity and NaN among them.

    Raises:
        InputError: it is; the message names it as the command line does.
    """
    if not isinstance(value, int | float):
        raise InputError(f"{name.replace('_', '-')} must be a number, not {value!r}")
    if not (least <= value <= most and math.isfinite(value)):
        wanted = f"{least:g} or more" if most == math.inf else f"{least:g} to {most:g}"
        raise InputError(f"{name.replace('_', '-')} must be {wanted}, not {value:g}")


def check_seed(name: str, seed: int, bits: int = 32) -> None:
    """Refuse a seed that is too large.

    Args:
        name: of the setting.
        seed: that was given.
        bits: that it may have; NumPy's older generator and Stable-Baselines3 take 32.

    Raises:
        InputError: it is negative, or has more bits; the message names it as the command line does.
    """
    if not isinstance(seed, int):
        raise InputError(f"{name.replace('_', '-')} must be a whole number, not {seed!r}")
    if not 0 <= seed < 2**bits:
        raise InputError(f"{name.replace('_', '-')} must be 0 to {2**bits - 1}, not {seed}")


def above_zero(name: str, value: float) -> None:
    """Refuse a number that is not more than 0, infinity and NaN among them.

    Raises:
        InputError: it is not; the message names it as the command line does.
    """
    if not isinstance(value, int | float):
        raise InputError(f"{name.replace('_', '-')} must be a number, not {value!r}")
    if not 0 < value < math.inf:
        raise InputError(f"{name.replace('_', '-')} must be more than 0, not {value:g}")


def multiple(name: str, value: float, unit: float) -> None:
    """Refuse a time that is no whole multiple of another, or negative, infinite or NaN.

    Args:
        name: of the setting.
        value: that was given [s].
        unit: that it must be a multiple of [s].

    Raises:
        InputError: it is none; the message names it as the command line does.
    """
    within(name, value, 0)
    if abs(value / unit - round(value / unit)) > _ROUNDING:
        raise InputError(
            f"{name.replace('_', '-')} must be a multiple of {unit:g} s, not {value:g}"
        )


def widths(name: str, layers: Sequence[int]) -> None:
    """Refuse widths of layers that no network here could have.

    Raises:
        InputError: there are too many, or one is out of range; the message names it as the command
            line does.
    """
    within(f"number of {name}", len(layers), 0, _MOST_LAYERS)
    for width in layers:
        within(name, width, 1, _WIDEST)


def whole_numbers(config: DataclassInstance, group: str = "") -> None:
    """Refuse a config with another value, such as 1.5, where a whole number is due.

    Args:
        config: whose fields of the types `int` and `tuple[int, ...]` are looked at.
        group: of settings that it is on the command line, such as "trainer".

    Raises:
        InputError: there is one; the message names the first as the command line does.
    """
    for name, hint in _hints(type(config)).items():
        value = getattr(config, name)
        if hint is int:
            value = (value,)
        elif hint != tuple[int, ...]:
            continue
        for each in value:
            if not isinstance(each, int) or isinstance(each, bool):
                option = ".".join(part for part in (group, name.replace("_", "-")) if part)
                raise InputError(f"{option} must be a whole number, not {each!r}")


def finite(config: DataclassInstance) -> None:
    """Refuse a config that holds a number that is negative, infinite or NaN.

    Raises:
        InputError: it does; the message names the first one as the command line does.
    """
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        for each in value if isinstance(value, tuple) else (value,):
            if isinstance(each, int | float):
                within(field.name, each, 0)


def one_of(name: str, value: str, choices: Sequence[str]) -> None:
    """Refuse a word that is not among the choices.

    Args:
        name: of the setting, such as "env.base".
        value: that was given.
        choices: all there are.

    Raises:
        InputError: it is another one; the message names it as the command line does.
    """
    if value not in choices:
        raise InputError(
            f"{name.replace('_', '-')} must be one of {', '.join(choices)}, not {value!r}"
        )


@cache
def _hints(kind: type[DataclassInstance]) -> dict[str, Any]:
    return typing.get_type_hints(kind)
