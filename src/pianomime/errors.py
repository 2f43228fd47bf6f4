"""The error for input that cannot be used, and the names that come closest to an unknown one."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(ValueError):
    """Something the caller gave cannot be used; the message is one line that says why.

    The command line prints the message and exits with code 2, without a traceback.
    """


class UnknownNameError(InputError):
    """There is nothing of that name."""


def unknown_name(kind: str, name: str, known: Iterable[str]) -> UnknownNameError:
    """The error for a name that nothing has, with the closest names and all there are.

    Args:
        kind: what the name should be of, such as "player".
        name: the name that was given.
        known: all names there are, in the order in which the message lists them.
    """
    names = list(known)
    hint = closest(name, names) or ";"
    return UnknownNameError(f"there is no {kind} {name!r}{hint} there are: {', '.join(names)}")


def closest(name: str, known: Iterable[str]) -> str:
    """A hint at the known names most like `name`, to append to a message.

    Args:
        name: the name that was given.
        known: all names there are.

    Returns:
        "; did you mean 'X'?", with at most three names, the most alike first, or "" if none is
        alike. Upper and lower case count as equal.
    """
    by_lower_case = {each.lower(): each for each in known}
    alike = get_close_matches(name.lower(), by_lower_case, n=3)
    if not alike:
        return ""
    return f"; did you mean {' or '.join(repr(by_lower_case[each]) for each in alike)}?"
