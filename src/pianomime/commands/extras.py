"""One clear message where an optional dependency is not installed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pianomime.errors import InputError


@contextmanager
def extra(name: str) -> Iterator[None]:
    """As a context: a missing package becomes a message that says which extra to install.

    Args:
        name: of the extra.

    Raises:
        InputError: a package is missing.
    """
    try:
        yield
    except ModuleNotFoundError as missing:
        raise InputError(
            f"this needs the package {missing.name}: pip install 'pianomime[{name}]'"
        ) from missing
