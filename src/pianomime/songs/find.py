"""From what a person names, a file or a bundled song, to MIDI files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pianomime import songs
from pianomime.errors import InputError

_SUFFIXES = (".mid", ".midi")


def find_song(name: str) -> Path:
    """The MIDI file that a name stands for.

    Args:
        name: path of a file, or name of a bundled song or a part of it: "ode to joy" will do.

    Raises:
        InputError: there is neither, or no name.
    """
    if not name.strip():
        raise InputError("a song with no name; `pianomime songs` lists those there are")
    path = Path(name)
    if path.is_dir():
        raise InputError(f"{name}: is a folder; name one song, or use `pianomime evaluate`")
    if path.exists():
        return path
    asked = name.lower().replace("_", "-").replace(" ", "-")
    found = [song for song in songs.names() if asked in song]
    if asked in found or len(found) == 1:
        return songs.path(asked if asked in found else found[0])
    raise InputError(
        f"{name}: no such file, nor one bundled song; those are: {', '.join(songs.names())}"
    )


def find_songs(names: Iterable[str | Path]) -> list[Path]:
    """All MIDI files that names stand for, each once, in order.

    Args:
        names: files, folders (all their MIDI files, also those further down) and bundled songs.

    Raises:
        InputError: a name stands for nothing, or a folder holds no MIDI file.
    """
    found: dict[Path, None] = {}
    for name in names:
        path = Path(name)
        if not path.is_dir():
            found[find_song(str(name))] = None
            continue
        inside = sorted(file for file in path.rglob("*") if file.suffix.lower() in _SUFFIXES)
        if not inside:
            raise InputError(f"{path}: no MIDI files in this folder")
        found.update(dict.fromkeys(inside))
    if not found:
        raise InputError("no songs")
    return list(found)
