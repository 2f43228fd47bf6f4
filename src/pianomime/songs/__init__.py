"""Songs that come with PianoMime: public-domain pieces, written down by hand in `notation`."""

from __future__ import annotations

from pathlib import Path

from pianomime.music import ScoreError

_FOLDER = Path(__file__).parent


def names() -> list[str]:
    """The names of the bundled songs, sorted."""
    return sorted(file.stem for file in _FOLDER.glob("*.mid"))


def path(name: str) -> Path:
    """The MIDI file of a bundled song.

    Raises:
        ScoreError: there is no such song.
    """
    if name not in names():
        raise ScoreError(f"no bundled song {name!r}; there are {', '.join(names())}")
    return _FOLDER / f"{name}.mid"


__all__ = ["names", "path"]
