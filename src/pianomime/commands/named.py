"""Reading an option before the command line is parsed, for defaults that depend on it."""

from __future__ import annotations


def option_value(option: str, arguments: list[str], otherwise: str) -> str:
    """The value of an option such as `--preset`.

    Args:
        option: its name, with the dashes.
        arguments: of the command line.
        otherwise: the value where the option is not given.
    """
    for place, argument in enumerate(arguments):
        if argument.startswith(f"{option}="):
            return argument.partition("=")[2]
        if argument == option and place + 1 < len(arguments):
            return arguments[place + 1]
    return otherwise
