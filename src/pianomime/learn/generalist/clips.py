"""The data that generalists learn from: clips, one after the other, that no sample crosses."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.archive import read_arrays
from pianomime.errors import InputError
from pianomime.learn.expert_data import ExpertData
from pianomime.video.demonstration import Demonstration
from pianomime.video.published import read_published

HUMAN = ("goal", "fingertips")
"""Columns of clips of humans."""
EXPERT = (*HUMAN, "joints", "velocities", "keys", "prior", "action")
"""Columns of clips of experts, as `pianomime.learn.episode.COLUMNS` describes them."""
_HELD_OUT = 12
"""Every how manieth song is kept from training, to see how well it generalises."""


@dataclass(frozen=True, eq=False)
class Clips:
    """Frames of clips.

    Attributes:
        columns: arrays (T, ...) by name.
        ends: (N,) one past the last frame of each clip.
        song: (N,) number that clips of one song share.
        name: of each clip.
    """

    columns: dict[str, NDArray[Any]]
    ends: NDArray[np.int64]
    song: NDArray[np.int64]
    name: list[str]

    def __len__(self) -> int:
        """Number of clips."""
        return len(self.ends)

    @property
    def starts(self) -> NDArray[np.int64]:
        """(N,) the first frame of each clip."""
        return np.concatenate(([0], self.ends[:-1]))

    def some(self, which: NDArray[np.bool_]) -> Clips:
        """The clips (N,) that are marked."""
        rows = np.repeat(which, np.diff(self.ends, prepend=0))
        return Clips(
            {name: array[rows] for name, array in self.columns.items()},
            np.cumsum(np.diff(self.ends, prepend=0)[which]),
            self.song[which],
            [name for name, kept in zip(self.name, which, strict=True) if kept],
        )

    def fingerprint(self) -> str:
        """Tells data from others."""
        digest = hashlib.sha256(json.dumps([self.name, self.ends.tolist()]).encode())
        for name in sorted(self.columns):
            digest.update(np.ascontiguousarray(self.columns[name]).data)
        return digest.hexdigest()[:16]

    def split(self) -> tuple[Clips, Clips]:
        """To learn from, and to see how well that went: no song is on both sides."""
        held = _held(self.song)
        return self.some(~held), self.some(held)


@dataclass(frozen=True, eq=False)
class HumanClip:
    """A demonstration to learn from.

    Attributes:
        demonstration: it.
        song: number that clips of one song share.
    """

    demonstration: Demonstration
    song: int


def read_human(source: Path) -> list[HumanClip]:
    """Demonstrations to learn from.

    Args:
        source: a folder of demonstrations, as `retarget` and `import-demos` write them, or an .npz
            file of published clips (length, fingertips, goal_packed). Of a file that tells `split`
            only what is called "train" is taken, and its `song_group` tells which are of one song.

    Raises:
        OSError: there is no such file.
        InputError: it holds no demonstrations.
    """
    if source.is_dir():
        files = sorted(source.rglob("*.npz"))
        found = [HumanClip(Demonstration.load(file), song) for song, file in enumerate(files)]
    else:
        arrays = read_arrays(source, "an .npz file of arrays")
        count = len(arrays.get("length", [0]))
        song = arrays.get("song_group", np.arange(count))
        split = arrays.get("split", np.full(count, "train"))
        odd = arrays.get("odd", np.zeros(count, bool))
        if not len(song) == len(split) == len(odd) == count:
            raise InputError(f"{source}: song_group, split and odd must have a value a clip")
        found = [
            HumanClip(demonstration, int(song[number]))
            for number, (demonstration, _) in enumerate(read_published(source))
            if split[number] == "train" and not odd[number]
        ]
    if not found:
        raise InputError(f"{source}: holds nothing to train on")
    return found


def held_out(clips: Sequence[HumanClip]) -> list[HumanClip]:
    """The clips that are kept from training, as `Clips.split` keeps those of all data sets."""
    kept = _held(np.array([clip.song for clip in clips]))
    return [clip for clip, one in zip(clips, kept, strict=True) if one]


def _held(song: NDArray[np.int64]) -> NDArray[np.bool_]:
    songs = np.unique(song)
    return np.isin(song, songs[min(_HELD_OUT // 2, len(songs) // 2) :: _HELD_OUT])


def human_clips(source: Path) -> Clips:
    """How humans play, see `read_human`.

    Raises:
        OSError: there is no such file.
        InputError: it holds no demonstrations, or values that are not finite.
    """
    return _together(
        source,
        (
            (
                clip.demonstration.score.title,
                clip.song,
                {
                    "goal": clip.demonstration.score.roll(),
                    "fingertips": clip.demonstration.plan.fingertips.astype(np.float32),
                },
            )
            for clip in read_human(source)
        ),
    )


def expert_clips(sources: Sequence[Path], columns: Sequence[str] = EXPERT) -> Clips:
    """How experts play, or teachers would: the episodes of data sets that are for training.

    Episodes of different data sets are of one song where these tell the same number.

    Args:
        sources: data sets.
        columns: which.

    Raises:
        InputError: a data set is not there, or values in it are not finite.
    """

    def clips() -> Iterator[tuple[str, int, dict[str, NDArray[Any]]]]:
        for source in sources:
            data = ExpertData.open(source)
            for number, about in enumerate(data.episodes):
                if about["split"] == "train":
                    arrays = data.columns(number, columns)
                    song = about["song"] if about["song"] >= 0 else -number - 1
                    yield about["name"], song, arrays

    return _together(", ".join(map(str, sources)), clips())


def _together(source: object, clips: Iterable[tuple[str, int, dict[str, NDArray[Any]]]]) -> Clips:
    names, songs, columns = [], [], []
    for name, song, arrays in clips:
        for column, array in arrays.items():
            if array.dtype.kind == "f" and not np.isfinite(array).all():
                raise InputError(f"{source}: {column} of {name} has values that are not finite")
        names.append(name)
        songs.append(song)
        columns.append(arrays)
    if not names:
        raise InputError(f"{source}: holds nothing to train on")
    ends = np.cumsum([len(arrays["goal"]) for arrays in columns])
    together = {
        column: np.concatenate([arrays[column] for arrays in columns]) for column in columns[0]
    }
    return Clips(together, ends, np.array(songs), names)
