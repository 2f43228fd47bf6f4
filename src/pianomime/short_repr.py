"""Short text of objects that hold arrays, for `print`, debuggers and failed tests."""

from __future__ import annotations

import dataclasses
import math
import reprlib
from typing import Any


def short_repr(thing: Any, *facts: str) -> str:
    """One line of what one wants to know of an object; it serves as `__repr__` of dataclasses.

    Args:
        thing: an instance of a dataclass.
        *facts: what to tell; if none is given, the fields are told, arrays by shape and type.

    Returns:
        Such as "<FingertipPlan 29.0 s, 317 notes>".
    """
    told = facts or tuple(
        f"{field.name}={_short(getattr(thing, field.name))}"
        for field in dataclasses.fields(thing)
        if field.repr
    )
    return f"<{type(thing).__name__} {', '.join(told)}>"


def count(number: int, noun: str) -> str:
    """A number and what it counts, such as "1 note" and "2 notes"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def _short(value: Any) -> str:
    if math.prod(getattr(value, "shape", ())) != 1 and hasattr(value, "dtype"):
        return f"{value.shape} {value.dtype}"
    return repr(value) if hasattr(value, "__dataclass_fields__") else reprlib.repr(value)
