"""The data set of trajectories: episodes one after the other, in zarr 3.

Read it with no more than zarr:

    import zarr

    data = zarr.open_group("experts.zarr", mode="r")
    ends = data["episode_end"][:]
    for first, end in zip([0, *ends], ends):
        joints, action = data["joints"][first:end], data["action"][first:end]

The attribute `description` of every array says what it holds; the attribute `episodes` of the group
has the name, the F1, the base controller, the song, the split and the world of each episode.

Every chunk ends with a checksum (CRC32C), which all readers of zarr compare. The attributes have a
digest of each column of each episode, too: a chunk that is gone reads as zeros.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.codecs import Crc32cCodec, ZstdCodec

from pianomime.errors import InputError, reason_of
from pianomime.files import new_folder
from pianomime.learn.data.episode import COLUMNS, Column, Episode
from pianomime.learn.data.format import FORMAT, VERSION, is_data_set, zarr_attributes
from pianomime.schema import Field, ListOf, Schema, short
from pianomime.seal import seal_of
from pianomime.sealed_json import sealed, unsealed
from pianomime.short_repr import short_repr
from pianomime.shown import shown
from pianomime.world_names import PAPER, WORLDS

_CHUNK = 4096
"""Rows in a chunk of the file."""
_DIGESTS = {name: Field("text") for name in COLUMNS}
_EPISODE: dict[str, Schema] = {
    "name": Field("text"),
    "f1": Field("float", (), 0, 1),
    "base": Field("text", choices=("ik", "dynamic")),
    "song_id": Field("int", (), -1),
    "split": Field("text"),
    "world": Field("text", choices=WORLDS, optional=True),
    "digests": _DIGESTS,
}
"""What is recorded of each episode."""
_SCHEMA: dict[str, Schema] = {
    "format": Field("text", choices=(FORMAT,)),
    "version": Field("int"),
    "ends": Field("int", ("E",), 1),
    "episodes": ListOf(_EPISODE),
}
"""Attributes of the group; `ends` is what the array `episode_end` says."""


def write_trajectories(path: Path, episodes: Iterator[Episode]) -> int:
    """Write episodes, all or nothing; an older data set at the same place is replaced.

    Args:
        path: of the data set, a folder.
        episodes: what to write, all of one world.

    Returns:
        Number of episodes.

    Raises:
        InputError: there is something else at the place, another process writes there, there are
            no episodes, or they were played in different worlds.
        OSError: it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # One of an earlier version, or a damaged one, is replaced as well.
    with new_folder(path, is_data_set, "a data set") as fresh:
        group = zarr.open_group(str(fresh), mode="w", zarr_format=3)
        for name, column in COLUMNS.items():
            array = group.create_array(
                name,
                shape=(0, *column.shape),
                dtype=column.dtype,
                chunks=_chunks(column),
                compressors=[ZstdCodec(), Crc32cCodec()],
                config={"write_empty_chunks": True},
            )
            array.attrs["description"] = column.description
        ends = [0]
        rows: list[Any] = []
        for episode in episodes:
            if rows:
                check_one_world(rows[0], episode.name, episode.world)
            for name, column in COLUMNS.items():
                _array(group, name).append(episode.columns[name].astype(column.dtype, copy=False))
            ends.append(ends[-1] + len(episode.columns["goal"]))
            rows.append(
                {
                    "name": episode.name,
                    "f1": episode.f1,
                    "base": episode.base,
                    "song_id": episode.song_id,
                    "split": episode.split,
                    "world": episode.world,
                    "digests": {name: _digest(episode.columns, name) for name in COLUMNS},
                }
            )
        if not rows:
            raise InputError("there are no episodes to collect")
        end_array = group.create_array("episode_end", data=np.array(ends[1:], np.int64))
        end_array.attrs["description"] = "one past the last row of each episode"
        content = {"format": FORMAT, "version": VERSION, "ends": ends[1:], "episodes": rows}
        group.attrs.update(sealed(content))
    return len(rows)


@dataclass(frozen=True, eq=False)
class TrajectoryData:
    """A data set on disk.

    Attributes:
        group: the zarr group.
        ends: (E,) one past the last row of each episode.
        episodes: name, f1, base, song_id, split and world of each, see `Episode`.
    """

    group: zarr.Group
    ends: NDArray[np.int64]
    episodes: list[dict[str, Any]]

    __repr__ = short_repr

    @classmethod
    def open(cls, path: Path) -> TrajectoryData:
        """Open a data set for reading.

        Raises:
            InputError: there is none, or one of another version or shape.
        """
        attributes = zarr_attributes(path)
        if attributes is None or attributes.get("format") != FORMAT:
            raise InputError(f"{path}: not a data set of trajectories")
        if attributes.get("version") != VERSION:
            raise InputError(
                f"{path}: a data set of version {short(attributes.get('version'))}; this program "
                f"reads {VERSION}: collect it again"
            )
        try:
            content = unsealed(attributes, _SCHEMA)
            ends = np.array(content["ends"], np.int64)
            if len(ends) != len(content["episodes"]) or (np.diff(ends, prepend=0) <= 0).any():
                raise InputError("its episodes do not end one after the other")
            group = zarr.open_group(str(path), mode="r", zarr_format=3)
            for name, column in COLUMNS.items():
                # Before memory is taken for what may be declared alone.
                array = _array(group, name)
                right = (int(ends[-1]), *column.shape), _chunks(column), np.dtype(column.dtype)
                if (array.shape, array.chunks, array.dtype) != right:
                    raise InputError(f"{name} has another shape, type or chunk")
            there = _array(group, "episode_end")
            if there.shape != ends.shape or max(there.chunks) > len(ends):
                raise InputError("episode_end has another shape or chunk")
            if not np.array_equal(np.asarray(there[:]), ends):
                raise InputError("episode_end is not what the attributes say")
        # A damaged store raises what its codecs and its metadata happen to raise.
        except Exception as error:
            raise InputError(f"{path}: damaged ({reason_of(error)})") from error
        # Data sets that do not say it were played in the paper's.
        return cls(group, ends, [{"world": PAPER, **facts} for facts in content["episodes"]])

    def __len__(self) -> int:
        """Number of episodes."""
        return len(self.ends)

    def columns(self, number: int, names: Iterable[str]) -> dict[str, NDArray[Any]]:
        """Some columns of one episode, in memory.

        Raises:
            InputError: they are damaged.
        """
        first = int(self.ends[number - 1]) if number else 0
        rows = slice(first, int(self.ends[number]))
        columns = {}
        try:
            for name in names:
                columns[name] = np.asarray(_array(self.group, name)[rows])
                if _digest(columns, name) != self.episodes[number]["digests"][name]:
                    raise InputError(f"{name} of episode {number} was changed or is missing")
                if columns[name].dtype.kind == "f" and not np.isfinite(columns[name]).all():
                    raise InputError(f"{name} of episode {number} is not finite")
        # A damaged store raises what its codecs happen to raise.
        except Exception as error:
            raise InputError(f"{self.group.store_path}: damaged ({reason_of(error)})") from error
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


def _array(group: zarr.Group, name: str) -> zarr.Array[Any]:
    array = group[name]
    if not isinstance(array, zarr.Array):
        raise TypeError(f"{name} is no array")
    return array


def _chunks(column: Column) -> tuple[int, ...]:
    return (_CHUNK, *column.shape)


def _digest(columns: Mapping[str, NDArray[Any]], name: str) -> str:
    """The seal of one column of an episode."""
    return seal_of({name: columns[name].astype(COLUMNS[name].dtype, copy=False)})
