"""MIDI files from the names that a user gives: files, folders and bundled songs."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from pianomime import songs
from pianomime.errors import InputError, UnknownNameError, closest

_SUFFIXES = (".mid", ".midi")


def find_song(name: str) -> Path:
    """The MIDI file of a name.

    Args:
        name: path of a file; or name of a bundled song, or a part of it such as "ode to joy".

    Raises:
        InputError: the name is empty or that of a folder.
        UnknownNameError: there is neither a file nor one bundled song of that name.
    """
    if not name.strip():
        raise InputError("the name of a song is empty; `pianomime songs` lists the bundled ones")
    path = Path(name)
    if path.is_dir():
        raise InputError(f"{name}: is a folder; name one song, or use `pianomime evaluate`")
    if path.exists():
        return path
    asked = name.lower().replace("_", "-").replace(" ", "-")
    found = [song for song in songs.names() if asked in song]
    if asked in found or len(found) == 1:
        return songs.path(asked if asked in found else found[0])
    if len(found) > 1:
        raise UnknownNameError(f"{name}: is part of more than one bundled song: {', '.join(found)}")
    hint = closest(asked.removesuffix(path.suffix.lower()), songs.names())
    hint = hint or _closest_file(path) or ";"
    raise UnknownNameError(
        f"{name}: no such file or bundled song{hint} bundled are: {', '.join(songs.names())}"
    )


def _closest_file(path: Path) -> str:
    """The MIDI files of the same folder with the most similar names, as the end of a message."""
    if not path.parent.is_dir():
        return ""
    beside = (file.name for file in path.parent.iterdir() if file.suffix.lower() in _SUFFIXES)
    return closest(path.name, beside)


def find_songs(names: Iterable[str | Path]) -> list[Path]:
    """The MIDI files of several names, each once, in order.

    Args:
        names: files, folders (with all MIDI files in them and below them) and bundled songs.

    Raises:
        InputError: a name is unknown, a folder holds no MIDI file, or there are no names.
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
