"""Parts of a data set in the making: the episode of each song that was played, in a file beside it.

The folder `DATA.parts` holds one sealed .npz file for each song, and the settings by which they are
played. A process that is killed, in whatever way, leaves whole files alone: the songs that it had
finished.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from pianomime.archive import read_archive, write_arrays
from pianomime.errors import InputError
from pianomime.file_names import file_name
from pianomime.files import atomic
from pianomime.learn.data.episode import COLUMNS, EVENTS, Episode, Source
from pianomime.schema import Field
from pianomime.sealed_json import parse_json, read_json, sealed, unsealed
from pianomime.shown import title_of
from pianomime.staging import is_staging

_VERSION = 1
"""Of the files."""
_SETTINGS = "settings.json"
_DIGITS = 16
"""Hexadecimal digits of the digest in a file's name."""
_KINDS = {"f": "float", "i": "int", "u": "int", "b": "bool"}
_SCHEMA = {
    "facts": Field("text"),
    **{
        name: Field(_KINDS[np.dtype(column.dtype).kind], (size, *column.shape))  # type: ignore[arg-type]
        for size, columns in (("T", COLUMNS), ("E", EVENTS))
        for name, column in columns.items()
    },
}


def parts_folder(out: Path) -> Path:
    """Where the parts of a data set are while it is made.

    Args:
        out: the data set.
    """
    return out.with_name(f"{out.name}.parts")


def part_paths(folder: Path, songs: Mapping[Path, str]) -> dict[Path, Path]:
    """The file of each song: that of the same content, by whatever title it was played before.

    Args:
        folder: of the parts.
        songs: files of music, with their digests.
    """
    there = {path.stem[-_DIGITS:]: path for path in parts_in(folder)}
    return {
        song: there.get(
            digest[:_DIGITS], folder / f"{file_name(title_of(song))}-{digest[:_DIGITS]}.npz"
        )
        for song, digest in songs.items()
    }


def parts_in(folder: Path) -> list[Path]:
    """The parts that there are, in the order of their names."""
    return sorted(folder.glob("*.npz"))


def open_parts(folder: Path, settings: dict[str, Any]) -> None:
    """Begin or go on with a folder of parts.

    Args:
        folder: of the parts; made if there is none.
        settings: by which songs are played, for JSON.

    Raises:
        InputError: there is something else at the place, or parts of other settings.
        OSError: it cannot be written.
    """
    path = folder / _SETTINGS
    if folder.exists() and not path.exists():
        inside = [each for each in folder.iterdir() if not is_staging(each.name)]
        if inside:
            raise InputError(f"{folder}: is something else than parts of a data set")
    folder.mkdir(exist_ok=True)
    if not parts_in(folder):  # Whoever began it was killed before anything was played.
        with atomic(path) as temporary:
            temporary.write_text(json.dumps(sealed({"settings": settings})), "utf-8")
        return
    try:
        known = unsealed(read_json(path), {"settings": Field("object")})["settings"]
    except InputError as error:
        raise InputError(f"{path}: damaged ({error})") from error
    check_settings(folder, known, settings)


def check_settings(path: Path, known: dict[str, Any], settings: dict[str, Any]) -> None:
    """Refuse settings other than those by which songs were played before.

    Args:
        path: of what was made by them, for the message.
        known: the settings of then.
        settings: those of now.

    Raises:
        InputError: they differ; the message names what does.
    """
    for name in sorted({*known, *settings}):
        then, now = known.get(name), settings.get(name)
        if then != now:
            raise InputError(
                f"{path}: was made with {name} {json.dumps(then)}, not {json.dumps(now)}; "
                "a data set is of one kind: name another place, or use the same settings"
            )


def close_parts(folder: Path) -> None:
    """Remove the parts that are in their data set now.

    The settings go last: until then, a folder that is left by a killed process is one of parts.
    """
    for path in parts_in(folder):
        path.unlink()
    (folder / _SETTINGS).unlink(missing_ok=True)
    folder.rmdir()


def save_part(path: Path, episode: Episode) -> None:
    """Write an episode, whole or not at all.

    Args:
        path: as of `part_paths`.
        episode: whose source is known.

    Raises:
        OSError: it cannot be written.
    """
    assert episode.source is not None
    names = ("name", "f1", "base", "song_id", "split", "world")
    facts = {name: getattr(episode, name) for name in names}
    text = json.dumps({**facts, "source": asdict(episode.source)})
    arrays = {"facts": np.array(text), **episode.columns, **episode.events}
    with atomic(path) as temporary:
        write_arrays(temporary, {"version": np.array(_VERSION), **arrays})


def load_part(path: Path) -> Episode:
    """Read what `save_part` wrote.

    Raises:
        InputError: it is damaged, or of another version.
        OSError: it cannot be read.
    """
    return read_archive(path, "a part of a data set", ("version", _VERSION), _SCHEMA, _episode)


def _episode(arrays: dict[str, Any]) -> Episode:
    facts = parse_json(str(arrays["facts"]))
    return Episode(
        **{**facts, "source": Source(**facts["source"])},
        columns={name: arrays[name].astype(COLUMNS[name].dtype) for name in COLUMNS},
        events={name: arrays[name].astype(EVENTS[name].dtype) for name in EVENTS},
    )
