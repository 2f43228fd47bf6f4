"""Schemas: what arrays and JSON in a file must be like, checked when it is opened.

A schema is plain data: a `Field` for a value or an array, a dictionary for an object with these
names, `ListOf` and `NamedBy` for any number of things of one kind. What does not fit raises an
`InputError` that names it; a library for JSON alone would leave the arrays to a second mechanism.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError

MOST_BYTES = 1024**3
"""Bytes of the largest array that is read: what claims more is damaged."""
_TEXT_BYTES = 64
"""Bytes that a text takes when it is looked at, even one that takes none in an array."""
_MOST_INT = 2**63 - 1
"""The largest whole number that arrays can hold."""

_KINDS = {"bool": "b", "int": "iu", "float": "f", "number": "biuf", "text": "U"}
"""Kinds of dtypes, as `numpy.dtype.kind`."""
_TYPES: dict[str, tuple[type, ...]] = {
    "bool": (bool,),
    "int": (int,),
    "float": (int, float),
    "text": (str,),
    "object": (dict,),
}
"""Types of JSON values."""


@dataclass(frozen=True)
class Field:
    """A value or an array.

    Attributes:
        kind: of its values; "number" is any of the first three, in arrays of others; "object" is
            any object of JSON.
        shape: () for a single value. Sizes that a schema leaves open are letters; one letter is
            one size in all arrays of a file.
        least, most: range of its numbers; both included.
        choices: the only texts; any if empty.
        optional: whether it may be missing.
        may_be_nan: whether NaN may stand in an array for what is not known.
        may_be_infinite: whether numbers of JSON may be infinite; those of arrays never are.
        may_be_null: whether null may stand in JSON for what could not be measured.
    """

    kind: Literal["bool", "int", "float", "number", "text", "object"]
    shape: tuple[int | str, ...] = ()
    least: float = -math.inf
    most: float = math.inf
    choices: tuple[str, ...] = ()
    optional: bool = False
    may_be_nan: bool = False
    may_be_infinite: bool = False
    may_be_null: bool = False

    def check_layout(
        self, name: str, dtype: np.dtype[Any], shape: Sequence[int], sizes: dict[str, int]
    ) -> None:
        """Check what is known of an array before it is read.

        Args:
            name: of the array.
            dtype: of the array.
            shape: of the array.
            sizes: the letters' sizes so far; those that are new are added.

        Raises:
            InputError: it is of another kind or shape, or larger than any that is written.
        """
        if dtype.kind not in _KINDS[self.kind]:
            raise InputError(f"{name} must be {self.kind}, not {dtype}")
        fits = len(shape) == len(self.shape) and all(
            size == (sizes.setdefault(want, size) if isinstance(want, str) else want)
            for want, size in zip(self.shape, shape, strict=True)
        )
        if not fits:
            wanted = ", ".join(str(sizes.get(str(want), want)) for want in self.shape)
            raise InputError(f"{name} must have the shape ({wanted}), not {tuple(shape)}")
        least = _TEXT_BYTES if dtype.kind == "U" else 1
        if math.prod(shape) * max(dtype.itemsize, least) > MOST_BYTES:
            raise InputError(f"{name} is larger than any that this program writes")

    def check_values(self, name: str, array: NDArray[Any]) -> None:
        """Check the values of an array.

        Raises:
            InputError: one is not finite, out of range, or not among the choices.
        """
        if self.kind == "text":
            try:
                texts = array.reshape(-1).tolist()
            except ValueError:
                raise InputError(f"{name} holds what is no text") from None
            for text in texts:
                self._check_choice(name, text)
        elif self.kind != "bool" and array.size:
            low, high = array.min(), array.max()
            if self.may_be_nan and np.isnan(low):
                known = array[~np.isnan(array)]
                if not known.size:
                    return
                low, high = known.min(), known.max()
            if not (np.isfinite(low) and np.isfinite(high)):
                raise InputError(f"{name} holds numbers that are not finite")
            self._check_range(name, low)
            self._check_range(name, high)

    def check_json(self, name: str, value: Any) -> None:
        """Check a value of JSON; an array is a list of lists.

        Raises:
            InputError: it is of another kind or shape, out of range, or not among the choices.
        """
        if value is None and self.may_be_null:
            return
        if self.shape:
            size, *rest = self.shape
            if not isinstance(value, list) or (isinstance(size, int) and len(value) != size):
                raise InputError(f"{name} must be a list of {size} ({self.kind})")
            inner = replace(self, shape=tuple(rest), may_be_null=False)
            for each in value:
                inner.check_json(name, each)
            return
        if type(value) not in _TYPES[self.kind]:
            raise InputError(f"{name} must be {self.kind}, not {short(value)}")
        if self.kind == "text":
            self._check_choice(name, value)
        elif self.kind in ("int", "float"):
            if isinstance(value, int) and abs(value) > _MOST_INT:
                raise InputError(f"{name} is too large")
            if not (math.isfinite(value) or (self.may_be_infinite and value == math.inf)):
                raise InputError(f"{name} must be finite")
            self._check_range(name, value)

    def _check_range(self, name: str, value: Any) -> None:
        if not self.least <= value <= self.most:
            raise InputError(f"{name} must be {self.least:g} to {self.most:g}, not {value}")

    def _check_choice(self, name: str, text: str) -> None:
        if self.choices and text not in self.choices:
            raise InputError(f"{name} must be one of {', '.join(self.choices)}, not {short(text)}")


@dataclass(frozen=True)
class ListOf:
    """A list of JSON, each entry of which fits a schema."""

    schema: Schema


@dataclass(frozen=True)
class NamedBy:
    """An object of JSON with any names, each entry of which fits a schema."""

    schema: Schema


Schema = Field | ListOf | NamedBy | Mapping[str, "Schema"]
"""What a file, or a part of it, must be like."""


def check_names(names: Sequence[str], schema: Mapping[str, Schema], more: bool = False) -> None:
    """Check which names there are.

    Args:
        names: that there are.
        schema: that they must be those of.
        more: whether there may be others.

    Raises:
        InputError: one is missing, unknown, or there twice.
    """
    if len(set(names)) != len(names):
        raise InputError("a name stands twice")
    for name, field in schema.items():
        if name not in names and not (isinstance(field, Field) and field.optional):
            raise InputError(f"{name} is missing")
    if not more and (odd := sorted(set(names) - set(schema))):
        raise InputError(f"{short(odd[0])} does not belong there")


def check_json(content: Any, schema: Schema, name: str = "the content") -> None:
    """Check content of JSON against a schema.

    Raises:
        InputError: it does not fit; the message names what does not, in one line.
    """
    if isinstance(schema, Field):
        schema.check_json(name, content)
    elif isinstance(schema, ListOf):
        if not isinstance(content, list):
            raise InputError(f"{name} must be a list, not {short(content)}")
        for number, each in enumerate(content):
            check_json(each, schema.schema, f"{name} {number}")
    else:
        if not isinstance(content, dict):
            raise InputError(f"{name} must be an object, not {short(content)}")
        if isinstance(schema, Mapping):
            check_names(list(content), schema)
        for inner, value in content.items():
            rule = schema[inner] if isinstance(schema, Mapping) else schema.schema
            check_json(value, rule, short(inner)[1:-1])


def short(value: object) -> str:
    """A value for a message, in one line that is not long."""
    text = ascii(value) if isinstance(value, str) else repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
