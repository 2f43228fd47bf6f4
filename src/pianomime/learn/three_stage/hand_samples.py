"""What the second and the third stage learn: how a hand moves, and its controls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import NO_KEY
from pianomime.learn.data.dataset import DEMONSTRATION_COLUMNS, Dataset
from pianomime.policies.features import rest_points
from pianomime.policies.horizon import CHUNK
from pianomime.policies.three_stage.hand_controls import (
    TARGETS,
    controls_action,
    controls_observation,
)
from pianomime.policies.three_stage.hand_motion import PRESSES, motion_action, motion_observation
from pianomime.short_repr import short_repr
from pianomime.world.hand import both_hands, hand_points
from pianomime.world.layout import LAYOUT, POINT_COUNT

CONTROLS_COLUMNS = (*DEMONSTRATION_COLUMNS, "joints", "velocities", "keys", "action")
"""Columns of a data set that the third stage learns from."""

_Batch = dict[str, NDArray[Any]]
_SHAKEN = 0.7
"""Share of the samples of motion in which a hand is not where it was in the data."""
_TIP_NOISE = np.array([0.002, 0.004])
"""(2,) Standard deviation of that along x and y, of each point [m]."""
_HAND_NOISE = 0.008
"""Standard deviation of that along y, of all points of a hand [m]."""
_SPEED_NOISE = 0.002
"""Standard deviation of how far it moved in the frame before [m]."""
_RETURN = np.array([0.75, 0.5, 0.25, 0.1])
"""(CHUNK,) Share of the noise that is left in each frame to come: hands return smoothly."""
_TARGET_NOISE = 0.006
"""Standard deviation of the targets of wrists and idle fingertips, for controls [m]: the second
stage is only roughly right."""


@dataclass(frozen=True, eq=False)
class MotionSamples:
    """Samples of a data set for the second stage; one is a hand in a frame.

    Attributes:
        dataset: with the columns `fingertips` and `finger_key`.
    """

    dataset: Dataset

    __repr__ = short_repr

    def __len__(self) -> int:
        """Number of frames."""
        return int(self.dataset.ends[-1])

    def draw(self, rng: np.random.Generator, batch: int) -> _Batch:
        """A random batch, with noise: `observation` (B, SIZE) and `target` (B, CHUNK, PLANE)."""
        row, side = _which(self.dataset, rng, batch)
        noise = rng.normal(0.0, _TIP_NOISE, (batch, POINT_COUNT, 2))
        noise[..., 1] += rng.normal(0.0, _HAND_NOISE, (batch, 1))
        noise *= rng.random((batch, 1, 1)) < _SHAKEN
        return self._at(row, side, noise, rng.normal(0.0, _SPEED_NOISE, noise.shape))

    def evenly(self, number: int) -> _Batch:
        """So many samples, evenly spread over all, without noise."""
        row, side = _evenly(self.dataset, number)
        still = np.zeros((len(row), POINT_COUNT, 2))
        return self._at(row, side, still, still)

    def _at(
        self,
        row: NDArray[np.int64],
        side: NDArray[np.int64],
        noise: NDArray[np.float64],
        speed: NDArray[np.float64],
    ) -> _Batch:
        columns = self.dataset.columns
        first, end = _clip(self.dataset, row)
        ahead = row[:, None] + np.arange(PRESSES)
        presses = columns["finger_key"][np.minimum(ahead, end[:, None] - 1), side[:, None]]
        presses = np.where((ahead < end[:, None])[..., None], presses, NO_KEY)
        # Before the first frame hands are at rest.
        was, before = (
            np.where(
                (row - back >= first)[:, None, None],
                columns["fingertips"][np.maximum(row - back, 0), side],
                rest_points()[side],
            )[..., :2]
            for back in (1, 2)
        )
        chunk = np.minimum(row[:, None] + np.arange(CHUNK), end[:, None] - 1)
        future = columns["fingertips"][chunk, side[:, None]][..., :2]
        points = was + noise
        return {
            "observation": motion_observation(presses, points, before + noise - speed, side),
            "target": motion_action(future + noise[:, None] * _RETURN[:, None, None], points, side),
        }


@dataclass(frozen=True, eq=False)
class ControlsSamples:
    """Samples of a data set for the third stage; one is a hand in a frame.

    Attributes:
        dataset: with the columns in `CONTROLS_COLUMNS`.
        points: (T, 2, 6, 3) wrists and fingertips before each frame [m].
    """

    dataset: Dataset
    points: NDArray[np.float32]

    __repr__ = short_repr

    @classmethod
    def of(cls, dataset: Dataset) -> ControlsSamples:
        """Prepare the samples of a data set."""
        return cls(dataset, hand_points(dataset.columns["joints"]).astype(np.float32))

    def __len__(self) -> int:
        """Number of frames."""
        return int(self.dataset.ends[-1])

    def draw(self, rng: np.random.Generator, batch: int) -> _Batch:
        """A random batch, with noise: `observation` (B, SIZE) and `target` (B, 1, 23)."""
        row, side = _which(self.dataset, rng, batch)
        # The same in all frames, as the errors of the stage before.
        return self._at(row, side, rng.normal(0.0, _TARGET_NOISE, (batch, 1, POINT_COUNT, 2)))

    def evenly(self, number: int) -> _Batch:
        """So many samples, evenly spread over all, without noise."""
        row, side = _evenly(self.dataset, number)
        return self._at(row, side, np.zeros((len(row), 1, POINT_COUNT, 2)))

    def _at(
        self, row: NDArray[np.int64], side: NDArray[np.int64], noise: NDArray[np.float64]
    ) -> _Batch:
        columns = self.dataset.columns
        _, end = _clip(self.dataset, row)
        ahead = row[:, None] + np.arange(TARGETS)
        there = np.minimum(ahead, end[:, None] - 1), side[:, None]
        # After the end nothing is pressed, and the last points are held.
        over = (ahead >= end[:, None])[..., None]
        presses = np.where(over, NO_KEY, columns["finger_key"][there])
        targets = columns["fingertips"][there].astype(np.float64)
        idle = np.pad(presses < 0, ((0, 0), (0, 0), (1, 0)), constant_values=True)
        targets[..., :2] += noise * idle[..., None]
        joints, velocities = (
            _of_side(columns[name][row], [LAYOUT.among_hands(hand) for hand in range(2)], side)
            for name in ("joints", "velocities")
        )
        ctrl = _of_side(columns["action"][row], [hand.actuators for hand in both_hands()], side)
        observation = controls_observation(
            joints,
            velocities,
            columns["keys"][row],
            self.points[row, side],
            targets,
            presses,
            side,
        )
        target = controls_action(ctrl, joints, side)[:, None]
        return {"observation": observation, "target": target.astype(np.float32)}


def _which(
    dataset: Dataset, rng: np.random.Generator, batch: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Random frames and hands (B,)."""
    return rng.integers(0, dataset.ends[-1], batch), rng.integers(0, 2, batch)


def _evenly(dataset: Dataset, number: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """So many frames, evenly spread, and hands in turns."""
    row = np.linspace(0, dataset.ends[-1] - 1, min(number, dataset.ends[-1])).astype(np.int64)
    return row, np.arange(len(row)) % 2


def _clip(dataset: Dataset, row: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The first frame, and one past the last, of the clips of frames (B,)."""
    clip = np.searchsorted(dataset.ends, row, side="right")
    return dataset.starts[clip], dataset.ends[clip]


def _of_side(
    both: NDArray[np.float32], places: list[slice], side: NDArray[np.int64]
) -> NDArray[np.float32]:
    """The numbers of one hand (B, .) of those of both (B, ...)."""
    left, right = (both[:, place] for place in places)
    return np.where(side[:, None] == 0, left, right)
