"""Data sets that policies learn from: clips, one after the other, that no sample crosses."""

from __future__ import annotations

import hashlib
import json
import warnings
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.data.published import read_published
from pianomime.learn.data.trajectories import TrajectoryData, check_one_world
from pianomime.plan.demonstration import TRAIN, Demonstration, is_demonstration
from pianomime.plan.plan_arrays import FINGER_KEY
from pianomime.policies.finger_assignment import flat_heights
from pianomime.short_repr import short_repr
from pianomime.shown import shown
from pianomime.songs.find import files_below
from pianomime.world_names import PAPER

DEMONSTRATION_COLUMNS = ("goal", "fingertips", "finger_key")
"""Columns of data sets made of demonstrations."""
TRAJECTORY_COLUMNS = (
    *DEMONSTRATION_COLUMNS,
    "joints",
    "velocities",
    "keys",
    "base_control",
    "action",
)
"""Columns of data sets made of played trajectories; `pianomime.learn.data.episode.COLUMNS` says
what they hold."""
_VALIDATION_SHARE = 1 / 12
"""Share of the songs that is kept for validation, about."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """Frames of clips, T in all.

    Attributes:
        columns: arrays (T, ...) by name; the heights of `fingertips` tell alone which press, see
            `flat_heights`.
        ends: (N,) one past the last frame of each clip.
        song_id: (N,) number that clips of one song share.
        name: N names of the clips.
    """

    columns: dict[str, NDArray[Any]]
    ends: NDArray[np.int64]
    song_id: NDArray[np.int64]
    name: list[str]

    __repr__ = short_repr

    def __len__(self) -> int:
        """Number of clips."""
        return len(self.ends)

    @property
    def starts(self) -> NDArray[np.int64]:
        """(N,) the first frame of each clip."""
        return np.concatenate(([0], self.ends[:-1]))

    def subset(self, mask: NDArray[np.bool_]) -> Dataset:
        """The clips that a mask (N,) selects."""
        lengths = np.diff(self.ends, prepend=0)
        rows = np.repeat(mask, lengths)
        return Dataset(
            {name: array[rows] for name, array in self.columns.items()},
            np.cumsum(lengths[mask]),
            self.song_id[mask],
            [name for name, kept in zip(self.name, mask, strict=True) if kept],
        )

    def digest(self) -> str:
        """Hash that identifies the data."""
        description = [self.name, self.ends.tolist(), self.song_id.tolist()]
        digest = hashlib.sha256(json.dumps(description).encode())
        for name in sorted(self.columns):
            digest.update(np.ascontiguousarray(self.columns[name]).data)
        return digest.hexdigest()[:16]

    def split(self) -> tuple[Dataset, Dataset]:
        """Training and validation sets, which have no song in common.

        A song is kept for validation if the hash of its number is low, about one in twelve,
        whatever else is in the data set. Only where that would be none or all of the songs, it
        depends on the others: the song with the lowest hash is then kept, or all but the one with
        the highest.
        """
        validation = _is_validation(self.song_id)
        return self.subset(~validation), self.subset(validation)


def read_demonstrations(source: Path) -> list[Demonstration]:
    """Demonstrations to learn from: those of the split "train".

    Args:
        source: a demonstration, as `retarget` and `import-demos` write them, a folder of such, or
            an .npz file of published clips, see `read_published`.

    Raises:
        OSError: there is no such file.
        InputError: it holds no demonstrations.
    """
    if source.is_dir():
        found = [
            Demonstration.load(file) for file in files_below(source, (".npz",), "demonstrations")
        ]
    elif is_demonstration(source):
        found = [Demonstration.load(source)]
    else:
        found = [demonstration for demonstration, _ in read_published(source)]
    found = [demonstration for demonstration in found if demonstration.split == TRAIN]
    if not found:
        raise InputError(f"{source}: holds nothing to train on")
    return found


def validation_demonstrations(demonstrations: Sequence[Demonstration]) -> list[Demonstration]:
    """The demonstrations of songs that `Dataset.split` keeps for validation."""
    songs = np.array([_song_number(one.song_id, one.score.title) for one in demonstrations])
    mask = _is_validation(songs)
    return [one for one, kept in zip(demonstrations, mask, strict=True) if kept]


def _is_validation(song: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Songs whose number's hash is low: at least one of them, and not all."""
    songs = np.unique(song)
    place = np.array([zlib.crc32(str(number).encode()) / 2**32 for number in songs])
    kept = ((place < _VALIDATION_SHARE) | (place == place.min())) & (place < place.max())
    return np.isin(song, songs[kept])


def _song_number(number: int, title: str) -> int:
    """The number of a song; where it is unknown, clips of one title count as one song."""
    return number if number >= 0 else zlib.crc32(shown(title).encode())


def demonstration_dataset(source: Path) -> Dataset:
    """Goals and fingertips of demonstrations, see `read_demonstrations`.

    Raises:
        OSError: there is no such file.
        InputError: it holds no demonstrations, or values that are not finite.
    """
    return _concatenate(
        source,
        (
            (
                one.score.title,
                _song_number(one.song_id, one.score.title),
                {
                    "goal": one.score.roll(),
                    "fingertips": one.plan.fingertips.astype(np.float32),
                    "finger_key": one.plan.finger_key,
                },
            )
            for one in read_demonstrations(source)
        ),
    )


def trajectory_dataset(
    sources: Sequence[Path], columns: Sequence[str] = TRAJECTORY_COLUMNS, base: str = ""
) -> Dataset:
    """Training episodes of trajectory data sets, of experts or of DAgger.

    Episodes of different data sets count as one song if these give it the same number, or name.

    Args:
        sources: the data sets.
        columns: which columns to read.
        base: the base controller that all must have been recorded with, if that matters.

    Raises:
        InputError: a data set is not there or cannot be used, values in it are not finite or no
            keys, or episodes were played in different worlds.
    """

    def clips() -> Iterator[tuple[str, int, dict[str, NDArray[Any]]]]:
        first = None
        for source in sources:
            data = TrajectoryData.open(source)
            for number, episode in enumerate(data.episodes):
                if episode["split"] == TRAIN:
                    if base not in ("", episode["base"]):
                        raise InputError(
                            f"{source}: {episode['name']} has the base controller "
                            f"{episode['base']}; this policy needs {base}"
                        )
                    if first is None:
                        first = episode
                        _warn_of_other_world(source, episode["world"])
                    check_one_world(first, episode["name"], episode["world"])
                    song = _song_number(episode["song_id"], episode["name"])
                    yield episode["name"], song, data.columns(number, columns)

    return _concatenate(", ".join(map(str, sources)), clips())


def _warn_of_other_world(source: Path, world: str) -> None:
    """Players of policies play in the paper's world unless they are told otherwise."""
    if world != PAPER:
        warnings.warn(
            f"{source}: played in the world {world}; play what learns from it with --world {world}",
            stacklevel=3,
        )


def _concatenate(
    source: object, clips: Iterable[tuple[str, int, dict[str, NDArray[Any]]]]
) -> Dataset:
    names, songs, columns = [], [], []
    for name, song, arrays in clips:
        for column, array in arrays.items():
            if array.dtype.kind == "f" and not np.isfinite(array).all():
                raise InputError(f"{source}: {column} of {name} has values that are not finite")
        FINGER_KEY.check_values(f"{source}: finger_key of {name}", arrays["finger_key"])
        # A policy is played with these: data sets of planners hold how high fingers hover, too.
        arrays["fingertips"] = flat_heights(arrays["fingertips"], arrays["finger_key"])
        names.append(name)
        songs.append(song)
        columns.append(arrays)
    if not names:
        raise InputError(f"{source}: holds nothing to train on")
    ends = np.cumsum([len(arrays["goal"]) for arrays in columns])
    concatenated = {
        column: np.concatenate([arrays[column] for arrays in columns]) for column in columns[0]
    }
    return Dataset(concatenated, ends, np.array(songs), names)
