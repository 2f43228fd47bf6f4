"""One clear message where an optional dependency is not installed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pianomime.errors import InputError
from pianomime.installation import install_command


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
        # One of our own that is missing is a fault of ours, and no extra brings it.
        if (missing.name or "").partition(".")[0] in ("", "pianomime"):
            raise
        raise InputError(
            f"this needs the package {missing.name}: {install_command(name)}"
        ) from missing
