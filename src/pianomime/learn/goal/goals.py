"""The goals in MIDI files, and drawing from them what the autoencoder learns from."""

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
from pianomime.keyboard import KEYS
from pianomime.learn.goal.config import GoalConfig
from pianomime.learn.goal.sdf import QUERY_HIGH, QUERY_LOW
from pianomime.learn.runs.tell import Tell
from pianomime.music import Score
from pianomime.songs.find import find_songs


@dataclass(frozen=True, eq=False)
class Goals:
    """Goals, each once.

    Attributes:
        packed: (N, 11) uint8, the 88 keys as `np.packbits` packs them.
        frames: (N,) int64, in how many frames of 0.05 s each was wanted.
    """

    packed: NDArray[np.uint8]
    frames: NDArray[np.int64]

    @classmethod
    def from_roll(cls, roll: NDArray[np.bool_]) -> Goals:
        """All goals in a (T, 88) roll."""
        rows = np.packbits(roll, axis=1)
        # Most goals last for many frames: what is left to be sorted is a tenth of them.
        begin = np.flatnonzero(np.append(True, (rows[1:] != rows[:-1]).any(axis=1)))
        return cls(*_once(rows[begin], np.diff(np.append(begin, len(rows)))))

    @classmethod
    def union(cls, goals: Sequence[Goals]) -> Goals:
        """All goals of some."""
        packed = np.concatenate([one.packed for one in goals])
        return cls(*_once(packed, np.concatenate([one.frames for one in goals])))

    def __len__(self) -> int:
        """Number of goals."""
        return len(self.packed)

    def keys(self, which: NDArray[np.intp] | slice = slice(None)) -> NDArray[np.bool_]:
        """(n, 88) the keys that some or all of the goals want."""
        return np.unpackbits(self.packed[which], axis=1).astype(bool)

    @property
    def digest(self) -> str:
        """What tells these goals from all others."""
        return hashlib.sha256(self.packed.tobytes() + self.frames.tobytes()).hexdigest()


@dataclass(frozen=True)
class GoalSplit:
    """Goals to learn from and goals to measure on, from different files.

    Attributes:
        train, unseen: the goals. Some may be in both: every piece has single notes.
        files, unseen_files: how many files they are from.
        skipped: files that could not be read.
    """

    train: Goals
    unseen: Goals
    files: int
    unseen_files: int
    skipped: int


def read_goals(folders: Sequence[Path], unseen: float, tell: Tell) -> GoalSplit:
    """The goals in MIDI files.

    Files of the same content count as one. Which are kept unseen depends on their content alone.

    Args:
        folders: of MIDI files, also further down.
        unseen: share of the files that is kept for measuring; two files at least are needed.
        tell: told how many files are read.

    Raises:
        InputError: a folder has none, or fewer than two files can be read, or there are too few
            goals in those that are kept.
    """
    found: dict[str, Goals] = {}
    skipped = 0
    paths = find_songs(folders)
    for done, path in enumerate(paths, 1):
        try:
            with warnings.catch_warnings():
                # Notes that no piano has are left out, which is no loss here.
                warnings.simplefilter("ignore")
                goals = Goals.from_roll(Score.from_midi(path).roll())
            found[hashlib.sha256(path.read_bytes()).hexdigest()] = goals
        except (InputError, OSError):
            skipped += 1
        tell(done, len(paths), f"{skipped} unreadable" if skipped else "")
    if len(found) < 2:
        raise InputError(
            f"two different MIDI files that can be read are needed, one of them to measure on; "
            f"there are {len(found)}"
        )
    order = sorted(found)
    first = min(max(math.ceil(unseen * len(order)), 1), len(order) - 1)
    split = GoalSplit(
        train=Goals.union([found[digest] for digest in order[first:]]),
        unseen=Goals.union([found[digest] for digest in order[:first]]),
        files=len(order) - first,
        unseen_files=first,
        skipped=skipped,
    )
    if split.unseen.keys(slice(3)).any(axis=1).sum() < 2:  # Silence is a goal, too.
        raise InputError("the files that are kept to measure on have too few chords and notes")
    return split


class GoalDraw:
    """Draws what the autoencoder learns from.

    A goal is drawn the more often the more frames want it, but by the square root: else held chords
    and silence would be most of it. It is moved along the keyboard, as far as its keys let it, and
    comes with points about the keyboard.

    Args:
        goals: what to draw from.
        config: how.
    """

    def __init__(self, goals: Goals, config: GoalConfig) -> None:
        self._goals, self._config = goals, config
        self._share = np.cumsum(np.sqrt(goals.frames))
        self._share /= self._share[-1]

    def __call__(self, rng: np.random.Generator, batch: int) -> dict[str, NDArray[np.float32]]:
        """`goal` (batch, 88), 0.0 or 1.0, and `query` (batch, queries, 3) [m]."""
        which = np.searchsorted(self._share, rng.random(batch), side="right")
        most = self._config.transpose
        moved = transpose(self._goals.keys(which), rng.integers(-most, most + 1, batch))
        query = rng.uniform(QUERY_LOW, QUERY_HIGH, (batch, self._config.queries, 3))
        return {"goal": moved.astype(np.float32), "query": query.astype(np.float32)}


def transpose(keys: NDArray[np.bool_], semitones: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Goals moved along the keyboard, as far as none of their keys leaves it.

    Args:
        keys: (N, 88) bool.
        semitones: (N,) by how many, upward where positive.

    Returns:
        (N, 88) bool.
    """
    # Of a silent goal these are 0 and 87: it may go anywhere, and stays silent.
    lowest, highest = keys.argmax(axis=1), KEYS - 1 - keys[:, ::-1].argmax(axis=1)
    shift = np.clip(semitones, -lowest, KEYS - 1 - highest)
    source = (np.arange(KEYS) - shift[:, None]) % KEYS
    return np.take_along_axis(keys, source, axis=1)


def _once(
    packed: NDArray[np.uint8], frames: NDArray[np.int64]
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    once, place = np.unique(packed, axis=0, return_inverse=True)
    # Whole numbers of frames are far below where floats cannot hold them.
    counted = np.bincount(place.reshape(-1), frames, len(once))
    return once, counted.astype(np.int64)
