"""The goals in MIDI files, and random batches of them to train the autoencoder on."""

from __future__ import annotations

import hashlib
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.files import files_digest
from pianomime.keyboard import KEYS
from pianomime.learn.goal.config import GoalConfig
from pianomime.learn.goal.sdf import QUERY_HIGH, QUERY_LOW
from pianomime.music import Score
from pianomime.progress import Progress
from pianomime.short_repr import short_repr
from pianomime.songs.find import find_songs


@dataclass(frozen=True, eq=False)
class Goals:
    """Distinct goals, N of them.

    Attributes:
        packed: (N, 11) uint8, the 88 keys as `np.packbits` packs them.
        frames: (N,) int64, number of frames that have each goal.
    """

    packed: NDArray[np.uint8]
    frames: NDArray[np.int64]

    __repr__ = short_repr

    @classmethod
    def from_roll(cls, roll: NDArray[np.bool_]) -> Goals:
        """All goals in a (T, 88) roll."""
        rows = np.packbits(roll, axis=1)
        # Most goals last for many frames: a tenth of them is left to be sorted.
        begin = np.flatnonzero(np.append(True, (rows[1:] != rows[:-1]).any(axis=1)))
        return cls(*_once(rows[begin], np.diff(np.append(begin, len(rows)))))

    @classmethod
    def union(cls, goals: Sequence[Goals]) -> Goals:
        """The goals of several sets, each once."""
        packed = np.concatenate([one.packed for one in goals])
        return cls(*_once(packed, np.concatenate([one.frames for one in goals])))

    def __len__(self) -> int:
        """Number of goals."""
        return len(self.packed)

    def keys(self, which: NDArray[np.intp] | slice = slice(None)) -> NDArray[np.bool_]:
        """(n, 88) bool, the keys of some goals, or of all."""
        return np.unpackbits(self.packed[which], axis=1).astype(bool)

    @property
    def digest(self) -> str:
        """Hash that identifies the goals."""
        return hashlib.sha256(self.packed.tobytes() + self.frames.tobytes()).hexdigest()


@dataclass(frozen=True)
class GoalSplit:
    """Training and validation goals, from different files.

    Attributes:
        train, validation: the goals. Some are in both: every piece has single notes.
        files, validation_files: numbers of their files.
        skipped: number of files that could not be read.
    """

    train: Goals
    validation: Goals
    files: int
    validation_files: int
    skipped: int


def read_goals(folders: Sequence[Path], validation_share: float, progress: Progress) -> GoalSplit:
    """The goals in MIDI files.

    Files of the same content count as one. The split depends on the content of the files alone.

    Args:
        folders: of MIDI files, also further down.
        validation_share: share of the files that is kept for validation; one file at least.
        progress: called with the files that are read.

    Raises:
        InputError: a folder has none, or fewer than two files can be read, or there are too few
            goals for validation.
    """
    found: dict[str, Goals] = {}
    skipped = 0
    paths = find_songs(folders)
    progress("reading", 0, len(paths))
    for done, path in enumerate(paths, 1):
        try:
            with warnings.catch_warnings():
                # Notes outside the keyboard are left out, which is no loss here.
                warnings.simplefilter("ignore")
                goals = Goals.from_roll(Score.from_midi(path).roll())
            found[files_digest([path])] = goals
        except (InputError, OSError):
            skipped += 1
        progress("reading", done, len(paths), f"{skipped} unreadable" if skipped else "")
    if len(found) < 2:
        raise InputError(
            f"two different MIDI files that can be read are needed, one of them for validation; "
            f"there are {len(found)}"
        )
    order = sorted(found)
    first = min(max(math.ceil(validation_share * len(order)), 1), len(order) - 1)
    split = GoalSplit(
        train=Goals.union([found[digest] for digest in order[first:]]),
        validation=Goals.union([found[digest] for digest in order[:first]]),
        files=len(order) - first,
        validation_files=first,
        skipped=skipped,
    )
    if split.validation.keys(slice(3)).any(axis=1).sum() < 2:  # Silence is a goal, too.
        raise InputError("the files that are kept for validation have too few chords and notes")
    return split


class GoalSampler:
    """Samples training batches of the autoencoder.

    The probability of a goal is proportional to the square root of its number of frames: else held
    chords and silence would dominate. Goals are transposed at random, as far as their keys stay on
    the keyboard, and come with random points about the keyboard.

    Args:
        goals: to sample from.
        config: number of points, and the range of the transposition.
    """

    def __init__(self, goals: Goals, config: GoalConfig) -> None:
        self._goals, self._config = goals, config
        self._share = np.cumsum(np.sqrt(goals.frames))
        self._share /= self._share[-1]

    def __call__(self, rng: np.random.Generator, batch: int) -> dict[str, NDArray[np.float32]]:
        """`goal` (batch, 88), 0.0 or 1.0, and `query` (batch, queries, 3) [m]."""
        which = np.searchsorted(self._share, rng.random(batch), side="right")
        limit = self._config.transpose
        moved = transpose(self._goals.keys(which), rng.integers(-limit, limit + 1, batch))
        query = rng.uniform(QUERY_LOW, QUERY_HIGH, (batch, self._config.queries, 3))
        return {"goal": moved.astype(np.float32), "query": query.astype(np.float32)}


def transpose(keys: NDArray[np.bool_], semitones: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Transpose goals, as far as none of their keys leaves the keyboard.

    Args:
        keys: (N, 88) bool.
        semitones: (N,) by how many; up if positive.

    Returns:
        (N, 88) bool.
    """
    # For silence these are 0 and 87: any shift will do, and it stays silent.
    lowest, highest = keys.argmax(axis=1), KEYS - 1 - keys[:, ::-1].argmax(axis=1)
    shift = np.clip(semitones, -lowest, KEYS - 1 - highest)
    source = (np.arange(KEYS) - shift[:, None]) % KEYS
    return np.take_along_axis(keys, source, axis=1)


def _once(
    packed: NDArray[np.uint8], frames: NDArray[np.int64]
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    once, place = np.unique(packed, axis=0, return_inverse=True)
    # Counts of frames are far below the limit to which floats are exact.
    counted = np.bincount(place.reshape(-1), frames, len(once))
    return once, counted.astype(np.int64)
