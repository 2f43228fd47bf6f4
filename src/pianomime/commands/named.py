"""What a command line names, before it is parsed: that is for its defaults to depend on."""

from __future__ import annotations


def named(option: str, arguments: list[str], otherwise: str) -> str:
    """The value of an option such as `--preset`, or what holds where it is not there."""
    for place, argument in enumerate(arguments):
        if argument.startswith(f"{option}="):
            return argument.partition("=")[2]
        if argument == option and place + 1 < len(arguments):
            return arguments[place + 1]
    return otherwise
