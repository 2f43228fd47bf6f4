"""The data that generalists learn from: clips, one after the other, that no sample crosses."""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.data.published import read_published
from pianomime.learn.data.trajectories import ExpertData
from pianomime.plan.demonstration import TRAIN, Demonstration

HUMAN = ("goal", "fingertips")
"""Columns of clips of humans."""
EXPERT = (*HUMAN, "joints", "velocities", "keys", "prior", "action")
"""Columns of clips of experts, as `pianomime.learn.data.episode.COLUMNS` describes them."""
_HELD_OUT = 1 / 12
"""Share of the songs that is kept from training, to see how well it generalises."""


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
        about = [self.name, self.ends.tolist(), self.song.tolist()]
        digest = hashlib.sha256(json.dumps(about).encode())
        for name in sorted(self.columns):
            digest.update(np.ascontiguousarray(self.columns[name]).data)
        return digest.hexdigest()[:16]

    def split(self) -> tuple[Clips, Clips]:
        """To learn from, and to see how well that went: no song is on both sides.

        Which songs are kept does not depend on what else there is.
        """
        held = _held(self.song)
        return self.some(~held), self.some(held)


def read_human(source: Path) -> list[Demonstration]:
    """Demonstrations to learn from: those of the split "train".

    Args:
        source: a folder of demonstrations, as `retarget` and `import-demos` write them, or an .npz
            file of published clips, see `read_published`.

    Raises:
        OSError: there is no such file.
        InputError: it holds no demonstrations.
    """
    if source.is_dir():
        found = [Demonstration.load(file) for file in sorted(source.rglob("*.npz"))]
    else:
        found = [demonstration for demonstration, _ in read_published(source)]
    found = [demonstration for demonstration in found if demonstration.split == TRAIN]
    if not found:
        raise InputError(f"{source}: holds nothing to train on")
    return found


def held_out(clips: Sequence[Demonstration]) -> list[Demonstration]:
    """The clips that are kept from training, as `Clips.split` keeps those of all data sets."""
    kept = _held(np.array([_song(clip.song, clip.score.title) for clip in clips]))
    return [clip for clip, one in zip(clips, kept, strict=True) if one]


def _held(song: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Songs whose number's hash is low: at least one of them, and not all."""
    songs = np.unique(song)
    place = np.array([zlib.crc32(str(number).encode()) / 2**32 for number in songs])
    held = ((place < _HELD_OUT) | (place == place.min())) & (place < place.max())
    return np.isin(song, songs[held])


def _song(number: int, title: str) -> int:
    """The number of a song; where nobody knows it, clips of one title are of one song."""
    return number if number >= 0 else zlib.crc32(title.encode())


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
                clip.score.title,
                _song(clip.song, clip.score.title),
                {
                    "goal": clip.score.roll(),
                    "fingertips": clip.plan.fingertips.astype(np.float32),
                },
            )
            for clip in read_human(source)
        ),
    )


def expert_clips(
    sources: Sequence[Path], columns: Sequence[str] = EXPERT, prior: str = ""
) -> Clips:
    """How experts play, or teachers would: the episodes of data sets that are for training.

    Episodes of different data sets are of one song where these tell the same number, or name.

    Args:
        sources: data sets.
        columns: which.
        prior: the prior that all must have been recorded with, if that matters.

    Raises:
        InputError: a data set is not there or cannot be used, or values in it are not finite.
    """

    def clips() -> Iterator[tuple[str, int, dict[str, NDArray[Any]]]]:
        for source in sources:
            data = ExpertData.open(source)
            for number, about in enumerate(data.episodes):
                if about["split"] == TRAIN:
                    if prior not in ("", about["prior"]):
                        raise InputError(
                            f"{source}: {about['name']} was played on the prior {about['prior']}; "
                            f"this stage is played on {prior}"
                        )
                    song = _song(about["song"], about["name"])
                    yield about["name"], song, data.columns(number, columns)

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
