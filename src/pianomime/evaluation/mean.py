"""Means over songs, which leave out what could not be measured of a song."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from pianomime.schema import Field, Schema

_DIGITS = 6
"""Of the fraction, as in the rows."""


class Mean(NamedTuple):
    """A mean of measures, of the structure of its schema.

    Attributes:
        value: the means; None where no song has a value.
        songs: in the place of every mean, of how many songs it is.
    """

    value: Any
    songs: Any


def mean(values: Sequence[Any], schema: Schema) -> Mean:
    """Mean of what was measured of songs.

    Args:
        values: of every song one, which fits the schema; None where it could not be measured.
        schema: a number, a list of numbers, or an object of these by name. Texts in an object, and
            optional names that no song has, are left out.
    """
    known = [value for value in values if value is not None]
    if isinstance(schema, Mapping):
        parts = {
            name: mean([value[name] for value in known if name in value], part)
            for name, part in schema.items()
            if not (isinstance(part, Field) and part.kind == "text")
            and any(name in value for value in known)
        }
        return Mean(
            {name: part.value for name, part in parts.items()},
            {name: part.songs for name, part in parts.items()},
        )
    if not known:
        return Mean(None, 0)
    if isinstance(known[0], list):
        return Mean([_mean(each) for each in zip(*known, strict=True)], len(known))
    return Mean(_mean(known), len(known))


def _mean(numbers: Sequence[float]) -> float:
    return round(sum(numbers) / len(numbers), _DIGITS)
