"""MIDI files from the names that a user gives: files, folders and bundled songs."""

from __future__ import annotations

import os
import stat
import warnings
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from pianomime import songs
from pianomime.errors import InputError, UnknownNameError, closest
from pianomime.music.other_kinds import advice, is_music, is_recording

MIDI_SUFFIXES = (".mid", ".midi", ".kar", ".rmi", ".rmid", ".smf")
"""Ends of the names of MIDI files, in lower case: of karaoke and in RIFF wrappers, too."""

_MIDI_BEGINS = b"MThd"


def find_song(name: str) -> Path:
    """The MIDI file of a name.

    Args:
        name: path of a file; or name of a bundled song, or a part of it such as "ode to joy".

    Raises:
        InputError: the name is empty, that of a folder, or that of music of another kind, such as
            sound; the message says what makes MIDI of it.
        UnknownNameError: there is neither a file nor one bundled song of that name.
    """
    if not name.strip():
        raise InputError("the name of a song is empty; `pianomime songs` lists the bundled ones")
    path = Path(name)
    if path.is_dir():
        raise InputError(f"{name}: is a folder; name one song, or use `pianomime evaluate`")
    if path.exists():
        if (instead := advice(path)) and not _begins_as_midi(path):
            raise InputError(f"{name}: is not a MIDI file; {instead}")
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


def find_recording(name: str) -> Path | None:
    """The recording of a name: a file of sound or a video; None if it is something else.

    Args:
        name: as `find_song` has it.
    """
    path = Path(name)
    return path if path.is_file() and is_recording(path) and not _begins_as_midi(path) else None


def _begins_as_midi(path: Path) -> bool:
    if not path.is_file():
        return False  # A pipe would wait for somebody who writes.
    with path.open("rb") as file:
        return file.read(len(_MIDI_BEGINS)) == _MIDI_BEGINS


def _closest_file(path: Path) -> str:
    """The MIDI files of the same folder with the most similar names, as the end of a message."""
    if not path.parent.is_dir():
        return ""
    beside = (file.name for file in path.parent.iterdir() if file.suffix.lower() in MIDI_SUFFIXES)
    return closest(path.name, beside)


def find_songs(names: Iterable[str | Path]) -> list[Path]:
    """The MIDI files of several names, each once, in order.

    Args:
        names: files, folders (with all MIDI files in them and below them, see `files_below`) and
            bundled songs.

    Raises:
        InputError: a name is unknown, a folder holds no MIDI file, or there are no names.
    """
    found: dict[Path, None] = {}
    for name in names:
        path = Path(name)
        if path.is_dir():
            found.update(dict.fromkeys(files_below(path, MIDI_SUFFIXES, "MIDI files")))
        else:
            found[find_song(str(name))] = None
    if not found:
        raise InputError("no songs")
    return list(found)


def files_below(folder: Path, suffixes: Iterable[str], kind: str) -> list[Path]:
    """The files in a folder and below it whose names have one of some ends, in order.

    A link that leads nowhere counts as a file, so that it is told when it is read. Hidden folders
    are left out, among them those that hold what is being written, and so are folders, pipes and
    devices of such names, and what macOS writes beside files (`._NAME`). One warning counts
    the files of other kinds of music, which are passed over; others tell which folders cannot be
    read.

    Args:
        folder: where to search; links to folders in it are not followed.
        suffixes: the ends, in lower case; upper and lower case count as equal.
        kind: what such files are called, such as "MIDI files".

    Raises:
        InputError: there are none.
    """
    found: list[Path] = []
    others: list[Path] = []
    for place, below, names in os.walk(folder, onerror=_unreadable):
        below[:] = [name for name in below if not name.startswith(".")]
        for path in (Path(place, name) for name in names if not name.startswith("._")):
            if path.suffix.lower() in suffixes:
                if _is_file_or_dangling(path):
                    found.append(path)
            elif is_music(path):
                others.append(path)
    counts = Counter(path.suffix.lower() for path in others).most_common()
    told = ", ".join(f"{count} {suffix}" for suffix, count in counts)
    if not found:
        instead = ""
        if others:
            usual = min(path for path in others if path.suffix.lower() == counts[0][0])
            instead = f"; of other kinds: {told}; {advice(usual)}"
        raise InputError(f"{folder}: no {kind} in this folder{instead}")
    if others:
        warnings.warn(f"{folder}: passed over, since no {kind}: {told}", stacklevel=2)
    return sorted(found)


def _unreadable(error: OSError) -> None:
    warnings.warn(
        f"{error.filename}: cannot be read, and is passed over: {error.strerror}", stacklevel=2
    )


def _is_file_or_dangling(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except OSError:
        return path.is_symlink()
