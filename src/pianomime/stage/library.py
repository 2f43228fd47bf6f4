"""The library of a stage: songs and performances by names that a page may use."""

from __future__ import annotations

import contextlib
import hashlib
import json
import threading
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pianomime import songs
from pianomime.errors import InputError
from pianomime.evaluation.measures import FRAMES, MUSIC
from pianomime.file_names import file_name
from pianomime.files import atomic
from pianomime.music import Score
from pianomime.players.performance import Performance, is_performance
from pianomime.shown import shown
from pianomime.songs.find import find_songs

_UPLOADS = "songs"
"""Folder of files that were dropped, in that of the stage."""
_SAVED = "performance.npz"


@dataclass(frozen=True)
class Song:
    """A MIDI file that can be played.

    Attributes:
        path: of the file.
        title: its name for readers.
        seconds: length of the music.
        notes: number of notes.
        remarks: what was mended or left out when it was read.
    """

    path: Path
    title: str
    seconds: float
    notes: int
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(cls, path: Path) -> Song:
        """Read a file.

        Raises:
            InputError: it cannot be played.
        """
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # `remarks` tells the same
            score = Score.from_midi(path)
        return cls(path, score.title, score.duration, len(score), tuple(score.remarks))


class Library:
    """Songs that come with the program, those that were given or dropped, and performances.

    Args:
        out: folder of the stage, in which its own performances are.
        given: MIDI files, performances, and folders of either.

    Raises:
        InputError: something given is not there, or is neither.
    """

    def __init__(self, out: Path, given: Sequence[Path]) -> None:
        self._out = out
        self._lock = threading.Lock()
        self._paths: dict[str, Path] = {}
        self._shown: dict[str, dict[str, Any]] = {}
        self._songs = [songs.path(name) for name in songs.names()]
        self._performances: list[Path] = []
        for path in given:
            self._add(path)
        uploads = out / _UPLOADS
        if uploads.is_dir():
            self._songs += sorted(uploads.glob("*.mid"))

    def listed(self) -> dict[str, list[Any]]:
        """All there is, for JSON.

        Returns:
            `songs`, `performances`, and `unreadable`: a line for each file that cannot be read, as
            one of another version.
        """
        own = sorted(self._out.glob(f"*/{_SAVED}"))
        listed: dict[str, list[Any]] = {"songs": [], "performances": [], "unreadable": []}
        for kind, paths, describe in (
            ("songs", self._songs, self._song),
            ("performances", dict.fromkeys([*own, *self._performances]), self._performance),
        ):
            for path in paths:
                try:
                    listed[kind].append(describe(path))
                except (InputError, OSError) as error:
                    listed["unreadable"].append(shown(error))
        return listed

    def path(self, number: str) -> Path | None:
        """The file of a song or performance that was listed, or None."""
        return self._paths.get(number)

    def upload(self, name: str, content: bytes) -> dict[str, Any]:
        """Keep a MIDI file that was dropped.

        Args:
            name: of the file, from somewhere else.
            content: of the file.

        Returns:
            The song as it is listed, with `remarks`.

        Raises:
            InputError: it is no MIDI file, or has no notes.
            OSError: it cannot be kept.
        """
        if not content:
            raise InputError("the file is empty")
        with self._lock:  # two may be of one name
            return self._keep(name, content)

    def _keep(self, name: str, content: bytes) -> dict[str, Any]:
        folder = self._out / _UPLOADS
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{file_name(Path(name).stem or 'song')}.mid"
        if path.exists() and path.read_bytes() != content:
            digest = hashlib.sha256(content).hexdigest()[:8]
            path = path.with_stem(f"{path.stem}-{digest}")
        if not path.exists():
            with atomic(path) as temporary:
                temporary.write_bytes(content)
                try:
                    Song.of(temporary)
                except InputError as error:
                    # Where it lies meanwhile says nothing to who dropped it.
                    reason = str(error).replace(str(temporary), name)
                    raise InputError(reason) from None
        if path not in self._songs:
            self._songs.append(path)
        return self._song(path)

    def _add(self, path: Path) -> None:
        if path.is_file() and is_performance(path):
            self._performances.append(path)
        elif path.is_dir():
            performances = [file for file in sorted(path.rglob("*.npz")) if is_performance(file)]
            self._performances += performances
            found = []
            if performances:
                # In results there need be no songs, and there is sound.
                with warnings.catch_warnings(), contextlib.suppress(InputError):
                    warnings.simplefilter("ignore")
                    found = find_songs([path])
            else:
                found = find_songs([path])
            # What a performance sounded like is no other song.
            played = {file.with_suffix(".mid") for file in performances}
            self._songs += [song for song in found if song not in played]
        else:
            self._songs += find_songs([path])

    def _song(self, path: Path) -> dict[str, Any]:
        number = _number("s", path)
        if number not in self._shown:
            song = Song.of(path)
            self._shown[number] = {
                "id": number,
                "title": song.title,
                "seconds": round(song.seconds, 3),
                "notes": song.notes,
                "remarks": list(song.remarks),
            }
        self._paths[number] = path
        return self._shown[number]

    def _performance(self, path: Path) -> dict[str, Any]:
        number = _number("p", path)
        if number not in self._shown:
            performance = Performance.load(path)
            self._shown[number] = {
                "id": number,
                "title": performance.score.title,
                "player": performance.player,
                "effort": performance.effort,
                "world": performance.world,
                "seconds": round(performance.song_seconds, 3),
                "measures": _measures(path),
            }
        self._paths[number] = path
        return self._shown[number]


def _measures(path: Path) -> list[list[str]]:
    """Labels and values out of the report beside a performance; none if there is no report."""
    try:
        row = json.loads((path.parent / "report.json").read_text(encoding="utf-8"))
        return [[each.label, each.show(row)] for each in (*MUSIC, FRAMES[0])]
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _number(kind: str, path: Path) -> str:
    """What a page calls a file: its path is nothing that a page needs to know."""
    stat = path.stat()
    told = f"{path.resolve()} {stat.st_mtime_ns} {stat.st_size}"
    return kind + hashlib.sha256(told.encode()).hexdigest()[:16]
