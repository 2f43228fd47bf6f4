"""Settings of players on a command line, such as `--planner.beam 200`."""

from __future__ import annotations

from pianomime.errors import InputError

GROUPS = ("planner", "tracker", "sampling", "sampler")
"""What options of settings begin with."""


def take_settings(arguments: list[str]) -> tuple[list[str], dict[str, str]]:
    """Settings, taken out of a command line.

    Which settings there are is for the player to say, so they cannot be options of the command.

    Args:
        arguments: of the command.

    Returns:
        The other arguments, and the settings by name, as texts.

    Raises:
        InputError: a setting has no value.
    """
    rest: list[str] = []
    settings: dict[str, str] = {}
    waiting = iter(arguments)
    for argument in waiting:
        name, equals, value = argument.removeprefix("--").partition("=")
        if not argument.startswith("--") or name.partition(".")[0] not in GROUPS or "." not in name:
            rest.append(argument)
            continue
        if not equals:
            try:
                value = next(waiting)
            except StopIteration:
                raise InputError(f"{argument}: needs a value") from None
        settings[name.replace("-", "_")] = value
    return rest, settings
