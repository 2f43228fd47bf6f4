"""Configs (frozen dataclasses) as JSON: written, read with checks, and compared by name."""

from __future__ import annotations

import dataclasses
import typing
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from pianomime.errors import InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_T = TypeVar("_T")

_MOST_INT = 2**63 - 1
"""The largest whole number that arrays can hold."""


ADDED = "added"
"""Metadata of a field that was added later: JSON may be without it, and is where it has its
default, so that older runs are read, and resumed, as those that they are."""


def to_json(config: DataclassInstance) -> dict[str, Any]:
    """A config as nested dictionaries that JSON can hold."""
    content = {}
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        if ADDED in field.metadata and value == field.default:
            continue
        nested = dataclasses.is_dataclass(value) and not isinstance(value, type)
        content[field.name] = to_json(value) if nested else value
    return content


def from_json(kind: type[_T], content: Any) -> _T:
    """The config that `to_json` wrote.

    Args:
        kind: the dataclass.
        content: what JSON gave.

    Raises:
        InputError: a field is missing, unknown, of another type, or refused by the config.
    """
    if not isinstance(content, dict):
        raise InputError(f"{kind.__name__} must be an object, not {content!r}")
    hints = typing.get_type_hints(kind)
    fields = dataclasses.fields(typing.cast("type[DataclassInstance]", kind))
    added = {field.name for field in fields if ADDED in field.metadata}
    if set(content) | added != set(hints):
        odd = ", ".join(sorted(set(content) ^ set(hints)))
        raise InputError(f"{kind.__name__} has other fields than this program's: {odd}")
    return kind(**{name: _value(name, hints[name], value) for name, value in content.items()})


def differences(stored: dict[str, Any], given: dict[str, Any], prefix: str = "") -> list[str]:
    """What two configs, as JSON, differ in.

    Args:
        stored: the config in a run's folder.
        given: the config of the present call.
        prefix: of the names, such as "env.".

    Returns:
        A line for each setting that differs: "name: value there, value now".
    """
    found: list[str] = []
    for name in {**stored, **given}:
        one, other = stored.get(name), given.get(name)
        if isinstance(one, dict) and isinstance(other, dict):
            found += differences(one, other, f"{prefix}{name}.")
        elif one != other:
            found.append(f"{prefix}{name}: {one} there, {other} now")
    return found


def _value(name: str, hint: Any, value: Any) -> Any:
    if dataclasses.is_dataclass(hint):
        return from_json(typing.cast(type[Any], hint), value)
    origin = typing.get_origin(hint)
    if origin is tuple and isinstance(value, list):
        return tuple(_value(name, typing.get_args(hint)[0], one) for one in value)
    if origin is Literal:
        right = value in typing.get_args(hint)
    elif hint is float:
        right = isinstance(value, int | float) and not isinstance(value, bool)
    else:
        right = type(value) is hint
    if isinstance(value, int) and abs(value) > _MOST_INT:
        right = False
    if not right:
        raise InputError(f"{name} cannot be {value!r}")
    return value
