"""Settings of players by name, such as `planner.beam`: into the configs that hold them."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from pianomime.errors import InputError, UnknownNameError, closest
from pianomime.players.player import Player

_Config = TypeVar("_Config")

PlayerFactory = Callable[..., Player]
"""Makes a player: called as `factory(effort=..., seed=..., **settings)`."""

Settings = Mapping[str, Any]
"""Values by name: "planner.beam", or in groups, {"planner": {"beam": 200}}; texts are converted."""


def flat(settings: Settings) -> dict[str, Any]:
    """Settings without groups: {"planner": {"beam": 200}} becomes {"planner.beam": 200}."""
    made: dict[str, Any] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            made |= {f"{name}.{inner}": each for inner, each in flat(value).items()}
        else:
            made[name] = value
    return made


def configure(settings: Settings, **configs: Any) -> tuple[Any, ...]:
    """Configs with the settings that belong to them.

    A setting is called after its group and its field, such as "planner.beam". Fields of configs
    within the config may be called in full, "planner.fingering.beam", and must be where another
    field has the same name.

    Args:
        settings: values by name.
        **configs: the config of each group, by the name of the group.

    Returns:
        The configs, in the order in which they were given.

    Raises:
        InputError: there is no such setting, its name stands for several, or its value is not of
            its kind or is out of range.
    """
    chosen = {group: dict[str, Any]() for group in configs}
    for name, value in flat(settings).items():
        group, _, field = name.partition(".")
        if group not in configs or not field:
            raise _unknown(name, configs)
        chosen[group][_path(field, configs[group], name, configs)] = value
    return tuple(_replaced(config, chosen[group], group) for group, config in configs.items())


def settings_of(**configs: Any) -> dict[str, Any]:
    """All settings of configs with their values, by names that are each as short as is clear."""
    made = {}
    for group, config in configs.items():
        leaves = list(_leaves(config))
        last = [path.rpartition(".")[2] for path, _ in leaves]
        for short, (path, value) in zip(last, leaves, strict=True):
            made[f"{group}.{short if last.count(short) == 1 else path}"] = value
    return made


def _unknown(name: str, configs: dict[str, Any]) -> InputError:
    known = settings_of(**configs)
    # There are dozens: without a close one, the groups will do.
    hint = closest(name, known) or f"; those there are begin with {', '.join(configs)}"
    return UnknownNameError(f"there is no setting {name!r}{hint}")


def _leaves(config: Any, within: str = "") -> Iterator[tuple[str, Any]]:
    """Path and value of every field that is not itself a config."""
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        if dataclasses.is_dataclass(value):
            yield from _leaves(value, f"{within}{field.name}.")
        else:
            yield f"{within}{field.name}", value


def _path(field: str, config: Any, name: str, configs: dict[str, Any]) -> str:
    """The path of the one field that a name stands for."""
    plain = field.replace("-", "_")
    found = [path for path, _ in _leaves(config) if path == plain or path.endswith(f".{plain}")]
    if plain in found:
        return plain
    if len(found) > 1:
        group = name.partition(".")[0]
        raise InputError(f"{name} may be {' or '.join(f'{group}.{path}' for path in found)}")
    if not found:
        raise _unknown(name, configs)
    return found[0]


def _replaced(config: _Config, values: dict[str, Any], group: str) -> _Config:
    """A config with other values at some paths.

    All values of a config are put in together, for it checks itself, and one may be right only
    with another.
    """
    made: dict[str, Any] = {}
    inner: dict[str, dict[str, Any]] = {}
    for path, value in values.items():
        field, _, rest = path.partition(".")
        if rest:
            inner.setdefault(field, {})[rest] = value
        else:
            made[field] = _converted(value, getattr(config, field), f"{group}.{field}")
    for field, within in inner.items():
        made[field] = _replaced(getattr(config, field), within, f"{group}.{field}")
    try:
        changed = dataclasses.replace(typing.cast(Any, config), **made)
    except InputError as error:
        raise InputError(f"{group}: {error}") from error
    return typing.cast(_Config, changed)


def _converted(value: Any, known: Any, name: str) -> Any:
    """A value as one of the kind that a field has."""
    if isinstance(value, str) and not isinstance(known, str):
        with contextlib.suppress(ValueError, RecursionError):  # It is reported below as what it is.
            value = json.loads(value)
    kind = type(known)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if kind is tuple and isinstance(value, list):
        value = tuple(value)
    if type(value) is not kind:
        raise InputError(f"{name} must be of the kind {kind.__name__}, not {value!r}")
    if isinstance(value, tuple):
        if len(value) != len(known):
            raise InputError(f"{name} must be {len(known)} numbers, not {value!r}")
        return tuple(_converted(each, one, name) for each, one in zip(value, known, strict=True))
    return value
