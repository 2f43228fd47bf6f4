"""The data set of trajectories: episodes one after the other, in zarr 3.

Read it with no more than zarr:

    import zarr

    data = zarr.open_group("experts.zarr", mode="r")
    ends = data["episode_end"][:]
    for first, end in zip([0, *ends], ends):
        joints, action = data["joints"][first:end], data["action"][first:end]

The attribute `description` of every array says what it holds; the attribute `episodes` of the group
has the name, the F1, the base controller, the song and the split of each episode.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.data.episode import COLUMNS, Episode

FORMAT = "pianomime experts"
VERSION = 3
_CHUNK = 4096
"""Rows in a chunk of the file."""
_EPISODE = {"name", "f1", "base", "song_id", "split"}
"""What is recorded of each episode."""


def write_trajectories(path: Path, episodes: Iterator[Episode]) -> int:
    """Write episodes, all or nothing; an older data set at the same place is replaced.

    Args:
        path: of the data set, a folder.
        episodes: what to write.

    Returns:
        Number of episodes.

    Raises:
        InputError: there is something else at the place, or there are no episodes.
        OSError: it cannot be written.
    """
    if path.exists():
        TrajectoryData.open(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{path.stem}-", dir=path.parent) as folder:
        fresh = Path(folder, path.name)
        group = zarr.open_group(str(fresh), mode="w", zarr_format=3)
        for name, column in COLUMNS.items():
            array = group.create_array(
                name,
                shape=(0, *column.shape),
                dtype=column.dtype,
                chunks=(_CHUNK, *column.shape),
            )
            array.attrs["description"] = column.description
        ends = [0]
        rows: list[Any] = []
        for episode in episodes:
            for name in COLUMNS:
                _array(group, name).append(episode.columns[name])
            ends.append(ends[-1] + len(episode.columns["goal"]))
            rows.append(
                {
                    "name": episode.name,
                    "f1": episode.f1,
                    "base": episode.base,
                    "song_id": episode.song_id,
                    "split": episode.split,
                }
            )
        if not rows:
            raise InputError("there are no episodes to collect")
        end_array = group.create_array("episode_end", data=np.array(ends[1:], np.int64))
        end_array.attrs["description"] = "one past the last row of each episode"
        group.attrs.update({"format": FORMAT, "version": VERSION, "episodes": rows})
        older = Path(folder, "older")
        if path.exists():
            os.replace(path, older)
        try:
            os.replace(fresh, path)
        except BaseException:
            if older.exists():
                os.replace(older, path)
            raise
        shutil.rmtree(older, ignore_errors=True)
    return len(rows)


@dataclass(frozen=True, eq=False)
class TrajectoryData:
    """A data set on disk.

    Attributes:
        group: the zarr group.
        ends: (E,) one past the last row of each episode.
        episodes: name, f1, base, song_id and split of each, see `Episode`.
    """

    group: zarr.Group
    ends: NDArray[np.int64]
    episodes: list[dict[str, Any]]

    @classmethod
    def open(cls, path: Path) -> TrajectoryData:
        """Open a data set for reading.

        Raises:
            InputError: there is none, or one of another version or shape.
        """
        try:
            group = zarr.open_group(str(path), mode="r")
            attributes = dict(group.attrs)
        # A damaged store raises what its codecs and its metadata happen to raise.
        except (OSError, LookupError, ValueError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: not a data set of trajectories") from error
        if attributes.get("format") != FORMAT:
            raise InputError(f"{path}: not a data set of trajectories")
        if attributes.get("version") != VERSION:
            raise InputError(
                f"{path}: a data set of version {attributes.get('version')}; this program reads "
                f"{VERSION}: collect it again"
            )
        try:
            ends = np.asarray(_array(group, "episode_end")[:])
            shapes = {name: _array(group, name).shape for name in COLUMNS}
        except (OSError, LookupError, ValueError, TypeError, RuntimeError) as error:
            raise InputError(f"{path}: damaged ({error})") from error
        whole = ends.ndim == 1 and ends.dtype.kind in "iu" and len(ends) > 0
        if not whole or not (np.diff(ends, prepend=0) > 0).all():
            raise InputError(f"{path}: damaged, its episodes do not end one after the other")
        for name, column in COLUMNS.items():
            if shapes[name] != (int(ends[-1]), *column.shape):
                raise InputError(f"{path}: {name} has another shape")
        episodes: Any = attributes.get("episodes")
        if not isinstance(episodes, list) or len(episodes) != len(ends):
            raise InputError(f"{path}: damaged, it does not describe each episode")
        if not all(isinstance(one, dict) and one.keys() >= _EPISODE for one in episodes):
            raise InputError(f"{path}: damaged, it lacks facts about its episodes")
        return cls(group, ends, episodes)

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
        try:
            return {name: np.asarray(_array(self.group, name)[rows]) for name in names}
        # A damaged store raises what its codecs happen to raise.
        except (RuntimeError, ValueError, OSError) as error:
            raise InputError(f"{self.group.store_path}: damaged ({error})") from error

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
        )


def _array(group: zarr.Group, name: str) -> zarr.Array[Any]:
    array = group[name]
    if not isinstance(array, zarr.Array):
        raise TypeError(f"{name} is no array")
    return array
