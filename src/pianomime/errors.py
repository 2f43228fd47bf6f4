"""The error for input that cannot be used, and the names that come closest to an unknown one."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

_MOST_NAMES = 3
"""Names that a message suggests at most."""
_SHORTEST_WORD = 4
"""Shorter words of a name are like too many others."""


class InputError(ValueError):
    """Something the caller gave cannot be used; the message is one line that says why.

    The command line prints the message and exits with code 2, without a traceback.
    """


class WorkFailed(RuntimeError):  # noqa: N818 - an outcome of the work, not a mistake
    """Work on good input came to nothing; the message is one line that says why.

    The command line prints the message and exits with code 1, without a traceback.
    """


class TrainingDiverged(WorkFailed):
    """The loss of a training is not a finite number any more."""


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
    """The known names most like `name`, as the end of a message.

    Args:
        name: the name that was given.
        known: all names there are.

    Returns:
        "; did you mean 'X'?", with at most three names, the most alike first, or "" if none is
        alike. A name is alike if one of its words is; upper and lower case count as equal.
    """
    by_word: dict[str, list[str]] = {}
    for each in known:
        words = [word for word in each.lower().split("-") if len(word) >= _SHORTEST_WORD]
        for word in dict.fromkeys([each.lower(), *words]):
            by_word.setdefault(word, []).append(each)
    alike = get_close_matches(name.lower(), by_word, n=_MOST_NAMES)
    names = list(dict.fromkeys(each for word in alike for each in by_word[word]))[:_MOST_NAMES]
    return f"; did you mean {' or '.join(map(repr, names))}?" if names else ""
