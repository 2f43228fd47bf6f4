"""Settings of players on a command line, such as `--planner.beam 200`."""

from __future__ import annotations

import json
from typing import Any

from pianomime.errors import InputError

OWN = "player."
"""What stands before a setting that is in no group, as those of other people's players may be."""


def take_settings(arguments: list[str]) -> tuple[list[str], dict[str, Any]]:
    """Settings, taken out of a command line.

    Which settings there are is for the player to say, so they cannot be options of the command:
    every option with a dot is one. `--player.NAME` sets NAME, a setting that is in no group.

    Args:
        arguments: of the command.

    Returns:
        The other arguments, and the settings by name: numbers and other JSON as what they are,
        anything else as text.

    Raises:
        InputError: a setting has no value.
    """
    rest: list[str] = []
    settings: dict[str, Any] = {}
    waiting = list(reversed(arguments))
    while waiting:
        argument = waiting.pop()
        name, equals, value = argument.removeprefix("--").partition("=")
        if not argument.startswith("--") or "." not in name:
            rest.append(argument)
            continue
        if not equals:
            if not waiting or waiting[-1].startswith("--"):
                raise InputError(f"{argument}: needs a value")
            value = waiting.pop()
        settings[name.removeprefix(OWN).replace("-", "_")] = _value(value)
    return rest, settings


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):  # a word, or brackets without end
        return text
