"""The data set of trajectories: episodes one after the other, in zarr 3.

Read it with no more than zarr:

    import zarr

    data = zarr.open_group("experts.zarr", mode="r")
    ends = data["episode_end"][:]
    for first, end in zip([0, *ends], ends):
        joints, action = data["joints"][first:end], data["action"][first:end]

What keys sensed between frames is in the arrays `event_*`, whose episodes end at `event_end`.

The attribute `description` of every array says what it holds; the attribute `episodes` of the group
has the name, the F1, the base controller, the song, the split, the world and the source of each
episode.

Every chunk of what was recorded ends with a checksum (CRC32C), which all readers of zarr compare.
Those of `episode_end` and `event_end` do not: they are compared with the attributes, which say the
same. The attributes have a digest of each column of each episode, too: a chunk that is gone reads
as zeros.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.codecs import Crc32cCodec, ZstdCodec

from pianomime.errors import InputError, reason_of
from pianomime.files import new_folder
from pianomime.learn.data.episode import COLUMNS, EVENTS, Column, Episode, Source
from pianomime.learn.data.format import (
    ATTRIBUTES,
    FORMAT,
    MOST_BYTES,
    VERSION,
    is_data_set,
    why_no_data_set,
    zarr_attributes,
)
from pianomime.schema import Field, ListOf, Schema, check_json, short
from pianomime.seal import seal_of
from pianomime.sealed_json import sealed, unsealed
from pianomime.short_repr import short_repr
from pianomime.shown import shown
from pianomime.world_names import PAPER, WORLDS

_CHUNK = 4096
"""Rows in a chunk of the file."""
_ARRAYS = {**COLUMNS, **EVENTS}
"""All arrays of an episode by name."""
_ENDS = {"episode_end": "ends", "event_end": "event_ends"}
"""Arrays of where episodes end, with the attributes that say the same."""
_DIGESTS = {name: Field("text") for name in _ARRAYS}
_MOST_EFFORT = 3
_SOURCE: dict[str, Schema] = {
    "title": Field("text"),
    "digest": Field("text"),
    "player": Field("text"),
    "effort": Field("int", (), 0, _MOST_EFFORT),
    "seed": Field("int", (), 0),
    "program": Field("text"),
}
"""Of a `Source`."""
_EPISODE: dict[str, Schema] = {
    "name": Field("text"),
    "f1": Field("float", (), 0, 1),
    "base": Field("text", choices=("ik", "dynamic")),
    "song_id": Field("int", (), -1),
    "split": Field("text"),
    "world": Field("text", choices=WORLDS, optional=True),
    "source": Field("object", optional=True),
    "digests": _DIGESTS,
}
"""What is recorded of each episode."""
_SCHEMA: dict[str, Schema] = {
    "format": Field("text", choices=(FORMAT,)),
    "version": Field("int"),
    "ends": Field("int", ("E",), 1),
    "event_ends": Field("int", ("E",), 0),
    "episodes": ListOf(_EPISODE),
    "settings": Field("object"),
    "failed": ListOf({"song": Field("text"), "error": Field("text")}),
}
"""Attributes of the group; `ends` is what the array `episode_end` says, `event_ends` what
`event_end` does."""


@dataclass(frozen=True)
class Making:
    """How a data set was made, as far as it tells.

    Attributes:
        settings: that decided how songs were played, for JSON; empty where nobody recorded them.
        failed: `song` and `error` of each song that could not be played.
    """

    settings: dict[str, Any] = field(default_factory=dict)
    failed: list[dict[str, str]] = field(default_factory=list)


UNKNOWN_MAKING = Making()
"""Of data sets that do not tell how they were made."""


def write_trajectories(
    path: Path,
    episodes: Iterator[Episode],
    making: Making = UNKNOWN_MAKING,
    card: Callable[[Path], str] | None = None,
) -> int:
    """Write episodes, all or nothing; an older data set at the same place is replaced.

    Args:
        path: of the data set, a folder.
        episodes: what to write, all of one world.
        making: how they were made.
        card: makes the text of the file `README.md` in the data set, of its path.

    Returns:
        Number of episodes.

    Raises:
        InputError: there is something else at the place, another process writes there, there are
            no episodes or too many, or they were played in different worlds.
        OSError: it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # One of an earlier version, or a damaged one, is replaced as well.
    with new_folder(path, is_data_set, "a data set") as fresh:
        group = zarr.open_group(str(fresh), mode="w", zarr_format=3)
        appenders = {}
        for name, column in _ARRAYS.items():
            array = group.create_array(
                name,
                shape=(0, *column.shape),
                dtype=column.dtype,
                chunks=_chunks(column),
                compressors=[ZstdCodec(), Crc32cCodec()],
                config={"write_empty_chunks": True},
            )
            array.attrs["description"] = column.description
            appenders[name] = _Appender(array)
        ends, event_ends = [0], [0]
        rows: list[Any] = []
        for episode in episodes:
            if rows:
                check_one_world(rows[0], episode.name, episode.world)
            arrays = {**episode.columns, **episode.events}
            for name, column in _ARRAYS.items():
                appenders[name].add(arrays[name].astype(column.dtype, copy=False))
            ends.append(ends[-1] + len(arrays["goal"]))
            event_ends.append(event_ends[-1] + len(arrays["event_key"]))
            rows.append(
                {
                    "name": episode.name,
                    "f1": episode.f1,
                    "base": episode.base,
                    "song_id": episode.song_id,
                    "split": episode.split,
                    "world": episode.world,
                    "digests": {name: _digest(arrays, name) for name in _ARRAYS},
                    **({} if episode.source is None else {"source": asdict(episode.source)}),
                }
            )
        if not rows:
            raise InputError("there are no episodes to collect")
        for appender in appenders.values():
            appender.flush()
        for name, values, rows_of in (
            ("episode_end", ends, "row"),
            ("event_end", event_ends, "event"),
        ):
            end_array = group.create_array(name, data=np.array(values[1:], np.int64))
            end_array.attrs["description"] = f"one past the last {rows_of} of each episode"
        content = {
            "format": FORMAT,
            "version": VERSION,
            "ends": ends[1:],
            "event_ends": event_ends[1:],
            "episodes": rows,
            "settings": making.settings,
            "failed": making.failed,
        }
        group.attrs.update(sealed(content))
        if (fresh / ATTRIBUTES).stat().st_size > MOST_BYTES:
            raise InputError(f"{path}: {len(rows)} episodes are too many for one data set")
        if card is not None:
            (fresh / "README.md").write_text(card(fresh), "utf-8")
    return len(rows)


@dataclass(frozen=True, eq=False)
class TrajectoryData:
    """A data set on disk.

    Attributes:
        path: of the data set, as it was given.
        group: the zarr group.
        ends: (E,) one past the last row of each episode.
        event_ends: (E,) one past the last event of each episode.
        episodes: name, f1, base, song_id, split and world of each, and its source if that is
            known, see `Episode`.
        making: how it was made.
    """

    path: Path
    group: zarr.Group
    ends: NDArray[np.int64]
    event_ends: NDArray[np.int64]
    episodes: list[dict[str, Any]]
    making: Making

    __repr__ = short_repr

    @classmethod
    def open(cls, path: Path) -> TrajectoryData:
        """Open a data set for reading.

        Raises:
            InputError: there is none, or one of another version or shape.
        """
        attributes = zarr_attributes(path)
        if attributes is None or attributes.get("format") != FORMAT:
            raise InputError(f"{path}: {why_no_data_set(path)}")
        if attributes.get("version") != VERSION:
            raise InputError(
                f"{path}: a data set of version {short(attributes.get('version'))}; this program "
                f"reads {VERSION}: collect it again"
            )
        try:
            content = unsealed(attributes, _SCHEMA)
            for facts in content["episodes"]:
                if "source" in facts:
                    check_json(facts["source"], _SOURCE, "source")
            ends, event_ends = (np.array(content[each], np.int64) for each in _ENDS.values())
            if not len(ends) == len(event_ends) == len(content["episodes"]):
                raise InputError("it has more or fewer ends than episodes")
            # An episode may be silent, but not empty.
            if (np.diff(ends, prepend=0) <= 0).any() or (np.diff(event_ends, prepend=0) < 0).any():
                raise InputError("its episodes do not end one after the other")
            group = zarr.open_group(str(path), mode="r", zarr_format=3)
            for name, column in _ARRAYS.items():
                # Before memory is taken for what may be declared alone.
                array = _array(group, name)
                length = int((ends if name in COLUMNS else event_ends)[-1])
                right = (length, *column.shape), _chunks(column), np.dtype(column.dtype)
                if (array.shape, array.chunks, array.dtype) != right:
                    raise InputError(f"{name} has another shape, type or chunk")
            for name, each in _ENDS.items():
                there = _array(group, name)
                if there.shape != ends.shape or max(there.chunks) > len(ends):
                    raise InputError(f"{name} has another shape or chunk")
                if not np.array_equal(np.asarray(there[:]), np.array(content[each])):
                    raise InputError(f"{name} is not what the attributes say")
        # A damaged store raises what its codecs and its metadata happen to raise.
        except Exception as error:
            raise InputError(f"{path}: damaged ({reason_of(error)})") from error
        # Data sets that do not say it were played in the paper's.
        episodes = [{"world": PAPER, **facts} for facts in content["episodes"]]
        making = Making(content["settings"], content["failed"])
        return cls(path, group, ends, event_ends, episodes, making)

    def __len__(self) -> int:
        """Number of episodes."""
        return len(self.ends)

    def columns(self, number: int, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        """Some columns of one episode, or of its events, in memory.

        Raises:
            InputError: they are damaged.
        """
        columns = {}
        try:
            for name in names:
                ends = self.ends if name in COLUMNS else self.event_ends
                rows = slice(int(ends[number - 1]) if number else 0, int(ends[number]))
                columns[name] = np.asarray(_array(self.group, name)[rows])
                if _digest(columns, name) != self.episodes[number]["digests"][name]:
                    raise InputError(f"{name} of episode {number} was changed or is missing")
                if columns[name].dtype.kind == "f" and not np.isfinite(columns[name]).all():
                    raise InputError(f"{name} of episode {number} is not finite")
        # A damaged store raises what its codecs happen to raise.
        except Exception as error:
            raise InputError(f"{self.path}: damaged ({reason_of(error)})") from error
        return columns

    def episode(self, number: int) -> Episode:
        """One episode, in memory."""
        facts = self.episodes[number]
        return Episode(
            facts["name"],
            facts["f1"],
            facts["base"],
            self.columns(number, COLUMNS),
            facts["song_id"],
            facts["split"],
            facts["world"],
            self.columns(number, EVENTS),
            Source(**facts["source"]) if "source" in facts else None,
        )


def check_one_world(first: Mapping[str, Any], name: str, world: str) -> None:
    """Refuse an episode of another world than the first: controls lead elsewhere there.

    Args:
        first: name and world of the first episode.
        name: of another one.
        world: in which that was played.

    Raises:
        InputError: they are of different worlds.
    """
    if world != first["world"]:
        raise InputError(
            f"{shown(name)} was played in the world {world}, {shown(first['name'])} in "
            f"{first['world']}: a data set is of one world"
        )


class _Appender:
    """Appends rows to an array by whole chunks: one that is added to is compressed anew.

    Args:
        array: without rows.
    """

    def __init__(self, array: zarr.Array[Any]) -> None:
        self._array = array
        self._waiting: list[NDArray[Any]] = []

    def add(self, rows: NDArray[Any]) -> None:
        """Append rows, some of which may wait for others."""
        self._waiting.append(rows)
        waiting = sum(map(len, self._waiting))
        if waiting >= _CHUNK:
            joined = np.concatenate(self._waiting)
            whole = waiting // _CHUNK * _CHUNK
            self._array.append(joined[:whole])
            # A copy: what was written can be given back.
            self._waiting = [joined[whole:].copy()]

    def flush(self) -> None:
        """Append those that wait."""
        if self._waiting:
            self._array.append(np.concatenate(self._waiting))
            self._waiting = []


def _array(group: zarr.Group, name: str) -> zarr.Array[Any]:
    try:
        array = group[name]
    except KeyError:
        raise InputError(f"the array {name} is missing") from None
    if not isinstance(array, zarr.Array):
        raise TypeError(f"{name} is no array")
    return array


def _chunks(column: Column) -> tuple[int, ...]:
    return (_CHUNK, *column.shape)


def _digest(columns: Mapping[str, NDArray[Any]], name: str) -> str:
    """The seal of one column of an episode."""
    return seal_of({name: columns[name].astype(_ARRAYS[name].dtype, copy=False)})
