"""What the first stage learns: for a key of a goal, the finger that pressed it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS, NO_KEY
from pianomime.learn.data.dataset import Dataset
from pianomime.policies.three_stage.fingering import (
    CHOICES,
    FINGERS,
    GOALS,
    LOWEST,
    NOBODY,
    Touched,
    decide,
    decided,
    key_observation,
)
from pianomime.short_repr import short_repr

_MIDDLE = 82
"""Sum of a key and of the key in its place in a mirror: black and white keys are symmetric about
D4."""
_HELD_SHARE = 0.15
"""Share of the samples that are kept in which a finger goes on as before: most of all do."""
_MOVED = 0.1
"""Share of idle fingers that pressed another key than they did, in training: as it may be where the
network decides otherwise than the data."""
_MOVED_BY = 3
"""Greatest distance of that key [keys]."""


@dataclass(frozen=True, eq=False)
class FingeringSamples:
    """Samples of a data set for the first stage; one is a key of the goal of a frame.

    Attributes:
        goal: (F, 88) goals of all frames, with silence before and after each clip.
        touched: what the fingers had pressed before each of F frames.
        row: (N,) frame of each sample.
        key: (N,) its key.
        choice: (N,) the finger that pressed it, left thumb first; `NOBODY`.
        below: (N,) choice of the next lower key of the goal; `LOWEST` where there is none.
        used: (N, 10) fingers that were given to lower keys.
    """

    goal: NDArray[np.bool_]
    touched: Touched
    row: NDArray[np.int64]
    key: NDArray[np.int64]
    choice: NDArray[np.int64]
    below: NDArray[np.int64]
    used: NDArray[np.bool_]

    __repr__ = short_repr

    @classmethod
    def of(cls, dataset: Dataset) -> FingeringSamples:
        """Samples of all clips of a data set with goals and what fingers press."""
        goals, touched, parts, frames = [], [], [], 0
        for first, end in zip(dataset.starts, dataset.ends, strict=True):
            goal, fingers = (dataset.columns[name][first:end] for name in ("goal", "finger_key"))
            for roll, finger_key in ((goal, fingers), mirrored(goal, fingers)):
                row, *rest = _choices(roll, finger_key)
                parts.append((row + frames + 1, *rest))
                goals.append(np.pad(roll, ((1, GOALS), (0, 0))))
                before = Touched.before(finger_key)
                touched.append([np.pad(part, ((1, GOALS), (0, 0))) for part in before])
                frames += len(goals[-1])
        row, key, choice, below, used = (
            np.concatenate(column) for column in zip(*parts, strict=True)
        )
        before = Touched(*(np.concatenate(part) for part in zip(*touched, strict=True)))
        return cls(np.concatenate(goals), before, row, key, choice, below, used)

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.row)

    def draw(self, rng: np.random.Generator, batch: int) -> dict[str, NDArray[Any]]:
        """A random batch, with noise: `observation` (B, SIZE) and `target` (B,), the choice."""
        which = rng.integers(0, len(self), batch)
        touched = self._touched(which)
        idle = (touched.since > 0) & (touched.key >= 0)
        other = np.clip(
            touched.key + rng.integers(-_MOVED_BY, _MOVED_BY + 1, idle.shape), 0, KEYS - 1
        )
        moved = idle & (rng.random(idle.shape) < _MOVED)
        return self._observed(which, touched._replace(key=np.where(moved, other, touched.key)))

    def evenly(self, number: int) -> dict[str, NDArray[Any]]:
        """So many samples, evenly spread over all, without noise."""
        which = np.linspace(0, len(self) - 1, min(number, len(self))).astype(np.int64)
        return self._observed(which, self._touched(which))

    def _touched(self, which: NDArray[np.int64]) -> Touched:
        return Touched(*(part[self.row[which]] for part in self.touched))

    def _observed(self, which: NDArray[np.int64], touched: Touched) -> dict[str, NDArray[Any]]:
        goal = self.goal[self.row[which, None] + np.arange(-1, GOALS)]
        observation = key_observation(goal, touched, self.key[which])
        decide(observation, decided(self.below[which], self.used[which]))
        return {"observation": observation, "target": self.choice[which]}


def mirrored(
    goal: NDArray[np.bool_], finger_key: NDArray[np.int8]
) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
    """Goals (T, 88) and what fingers press (T, 2, 5), as they are in a mirror.

    Keys that have none in their place are left out.
    """
    there = np.arange(_MIDDLE + 1)
    reflected = np.zeros_like(goal)
    reflected[:, there] = goal[:, _MIDDLE - there]
    swapped = finger_key[:, ::-1]
    in_place = (swapped >= 0) & (swapped <= _MIDDLE)
    return reflected, np.where(in_place, _MIDDLE - swapped, NO_KEY).astype(np.int8)


def _choices(goal: NDArray[np.bool_], finger_key: NDArray[np.int8]) -> tuple[NDArray[Any], ...]:
    """Row, key, choice, below and used of the samples of a clip: (T, 88) and (T, 2, 5)."""
    pressed = finger_key.reshape(len(finger_key), FINGERS)
    choice_of = np.full(goal.shape, NOBODY)
    frame, finger = np.nonzero(pressed >= 0)
    choice_of[frame, pressed[frame, finger]] = finger
    row, key = np.nonzero(goal)
    choice = choice_of[row, key]
    follows = np.append(False, row[1:] == row[:-1])[: len(row)]
    below = np.where(follows, np.roll(choice, 1), LOWEST)
    given = np.zeros((*goal.shape, CHOICES), bool)
    given[row, key, choice] = True
    # Exclusive: what keys below were given, not the key itself.
    lower = np.logical_or.accumulate(np.pad(given, ((0, 0), (1, 0), (0, 0))), axis=1)
    used = lower[row, key, :FINGERS]
    earlier = np.maximum(row - 1, 0)
    same = (row > 0) & goal[earlier, key] & (choice_of[earlier, key] == choice)
    # Which are kept depends on the clip alone.
    kept = ~same | (np.random.default_rng(len(row)).random(len(row)) < _HELD_SHARE)
    return row[kept], key[kept], choice[kept], below[kept], used[kept]
