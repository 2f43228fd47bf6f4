"""What to say where an optional part is not installed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pianomime.errors import InputError


@contextmanager
def extra(name: str) -> Iterator[None]:
    """Say how to install an extra if what is imported inside is not there.

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
