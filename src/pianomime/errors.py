"""The error for input that cannot be used, and the names that come closest to an unknown one."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from itertools import combinations

_MOST_NAMES = 3
"""Names that a message suggests at most."""
_LONGEST_REASON = 200
"""Letters of what another library says that a message repeats."""
_SHORTEST_PART = 4
"""Letters of the shortest part of a name that is compared: shorter ones are like many others."""


class InputError(ValueError):
    """Something the caller gave cannot be used; the message is one line that says why.

    The command line prints the message and exits with code 2, without a traceback.
    """


class WorkFailed(RuntimeError):  # noqa: N818 - an outcome of the work, not a mistake
    """Work on good input came to nothing; the message is one line that says why.

    The command line prints the message and exits with code 1, without a traceback.
    """


class TrainingDiverged(WorkFailed):
    """The loss of a training, or what its policy gives, is not a finite number any more."""


class UnknownNameError(InputError):
    """There is nothing of that name."""


def reason_of(error: Exception) -> str:
    """The first line of what an error of any library says, for a message; not all of a long one.

    Args:
        error: the message of which may be empty.
    """
    lines = str(error).splitlines() or [type(error).__name__]
    return lines[0][:_LONGEST_REASON]


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
        alike. A name is alike if some words of it are, such as "fur-elise" of
        "beethoven-fur-elise"; upper and lower case count as equal.
    """
    by_part: dict[str, list[str]] = {}
    for each in known:
        words = each.lower().split("-")
        runs = combinations(range(len(words) + 1), 2)
        parts = ["-".join(words[first:end]) for first, end in runs]
        for part in dict.fromkeys([each.lower(), *parts]):
            if part == each.lower() or len(part) >= _SHORTEST_PART:
                by_part.setdefault(part, []).append(each)
    alike = get_close_matches(name.lower(), by_part, n=_MOST_NAMES)
    names = list(dict.fromkeys(each for part in alike for each in by_part[part]))[:_MOST_NAMES]
    return f"; did you mean {' or '.join(map(repr, names))}?" if names else ""
