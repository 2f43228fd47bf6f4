"""Bundled songs: public-domain pieces, written by hand in `notation`."""

from __future__ import annotations

from pathlib import Path

from pianomime.errors import unknown_name

_FOLDER = Path(__file__).parent


def names() -> list[str]:
    """Names of the bundled songs, sorted."""
    return sorted(file.stem for file in _FOLDER.glob("*.mid"))


def path(name: str) -> Path:
    """The MIDI file of a bundled song.

    Args:
        name: one of `names()`.

    Raises:
        UnknownNameError: there is no such song.
    """
    if name not in names():
        raise unknown_name("bundled song", name, names())
    return _FOLDER / f"{name}.mid"


__all__ = ["names", "path"]
