"""Training samples of a data set: the observation in one frame, and the action chunk to learn."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.learn.data.dataset import Dataset
from pianomime.learn.imitation.config import PolicyConfig
from pianomime.policies.features import (
    OCTAVE,
    Observation,
    action_reference,
    fingertip_observation,
    octave_width,
    relative_to_wrist,
    rest_points,
    tracking_observation,
)
from pianomime.policies.horizon import CHUNK, GOAL_HORIZON
from pianomime.short_repr import short_repr
from pianomime.world.hand import both_hands, hand_points
from pianomime.world.layout import LAYOUT, POINT_COUNT, POINTS_SIZE

_BOTH_POINTS = 2 * POINT_COUNT
_SLIDES = tuple(LAYOUT.among_hands(hand).start + LAYOUT.slide for hand in (1, 0))
"""Joints that carry the forearms along the keyboard, right and left; y rises as they do."""
_SLIDE_CONTROLS = tuple(
    LAYOUT.actuators[hand].start + LAYOUT.slide_actuators.start for hand in (1, 0)
)


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of a data set for one policy; one can begin at each of its T frames.

    Attributes:
        dataset: where they are from.
        config: of the policy.
        points: (T, 2, 6, 3) present points in each frame [m]: those of the joints, or for high
            levels the fingertips of the frame before.
    """

    dataset: Dataset
    config: PolicyConfig
    points: NDArray[np.float32]

    __repr__ = short_repr

    @classmethod
    def of(cls, dataset: Dataset, config: PolicyConfig) -> Samples:
        """Prepare the samples of a data set for a policy."""
        if config.level == "high":
            points = np.roll(dataset.columns["fingertips"], 1, axis=0)
            points[dataset.starts] = rest_points()
        else:
            points = hand_points(dataset.columns["joints"])
        return cls(dataset, config, points.astype(np.float32))

    def __len__(self) -> int:
        """Number of samples: one for each frame."""
        return int(self.dataset.ends[-1])

    def draw(self, rng: np.random.Generator, batch: int) -> Observation:
        """A random batch with augmentation: octave shifts and noise as the config has them."""
        rows = rng.integers(0, len(self), batch)
        octaves = rng.integers(-1, 2, batch) if self.config.transpose else np.zeros(batch, np.int64)
        sample = self._absolute(rows, octaves)
        if self.config.level == "high":
            noise = rng.normal(0.0, self.config.tip_noise, (batch, 2, POINT_COUNT, 3))
            noise[:, :, 0, 1] += rng.normal(0.0, self.config.hand_noise, (batch, 2))
            sample["vector"] += noise.reshape(batch, POINTS_SIZE).astype(np.float32)
        elif self.config.level == "low":
            # The same in all frames of a chunk, and in targets and tracking errors. Fingertips that
            # press, at z = 0, have none.
            noise = rng.normal(0.0, self.config.target_noise, (batch, 1, 1, _BOTH_POINTS, 3))
            frames = sample["frames"].reshape(batch, CHUNK, 2, _BOTH_POINTS, 3)
            noise = noise * (frames[:, :, :1, :, 2:] > 0.0) * [1.0, 1.0, 0.0]
            sample["frames"] = (frames + noise).reshape(batch, CHUNK, -1).astype(np.float32)
        return self._relative(sample)

    def evenly(self, number: int) -> Observation:
        """So many samples, evenly spread over all, without augmentation."""
        rows = np.linspace(0, len(self) - 1, min(number, len(self))).astype(np.int64)
        return self.at(rows, np.zeros(len(rows), np.int64))

    def at(self, rows: NDArray[np.int64], octaves: NDArray[np.int64]) -> Observation:
        """Observations in frames (B,), and as `target` (B, T, D) the actions to learn.

        The target is relative to `action_reference`. Beyond the end of a clip its last frame is
        held, and its goals are silence.

        Args:
            rows: (B,) frames.
            octaves: (B,) by how many octaves to move the sample up. It stays where it is if that
                leads off the keyboard, or in its first frame to controls beyond the reach of the
                forearms.
        """
        return self._relative(self._absolute(rows, octaves))

    def _relative(self, sample: Observation) -> Observation:
        config = self.config
        reference = action_reference(config.level, config.residual, sample["vector"])
        target = sample["target"] - reference
        return {**sample, "target": target[:, : config.chunk].astype(np.float32)}

    def _absolute(self, rows: NDArray[np.int64], octaves: NDArray[np.int64]) -> Observation:
        """As `at`, with a target that is not relative to anything."""
        columns, config = self.dataset.columns, self.config
        end = self.dataset.ends[np.searchsorted(self.dataset.ends, rows, side="right")]
        ahead = rows[:, None] + np.arange(GOAL_HORIZON if config.level == "high" else CHUNK)
        inside = ahead < end[:, None]
        goal = columns["goal"][np.minimum(ahead, end[:, None] - 1)] & inside[..., None]
        chunk = np.minimum(rows[:, None] + np.arange(CHUNK), end[:, None] - 1)
        targets = columns["fingertips"][chunk]
        octaves = self._feasible(rows, goal, octaves)
        shift = (octaves * octave_width()).astype(np.float32)
        goal = _transpose(goal, octaves)
        targets = targets + _along_keyboard(shift)[:, None]
        points = self.points[rows] + _along_keyboard(shift)
        if config.level == "high":
            target = relative_to_wrist(targets).reshape(len(rows), CHUNK, POINTS_SIZE)
            return {**fingertip_observation(goal, points), "target": target}
        joints, base, action = columns["joints"][rows], None, columns["action"][chunk]
        joints = _slide(joints, shift, _SLIDES)
        action = _slide(action, shift, _SLIDE_CONTROLS)
        if config.residual:
            base_control = _slide(columns["base_control"][chunk], shift, _SLIDE_CONTROLS)
            base, action = base_control[:, 0], action - base_control
        observation = tracking_observation(
            goal,
            targets if config.level == "low" else None,
            points,
            joints,
            columns["velocities"][rows],
            _transpose(columns["keys"][rows], octaves),
            base,
        )
        return {**observation, "target": action}

    def _feasible(
        self, rows: NDArray[np.int64], goal: NDArray[np.bool_], octaves: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """The octaves (B,) by which each sample can be moved."""
        used = np.asarray(goal.any(axis=1))
        if self.config.level != "high":
            used = used | (self.dataset.columns["keys"][rows] > 0)
        low, high = used[:, :OCTAVE].any(axis=1), used[:, KEYS - OCTAVE :].any(axis=1)
        off_keyboard = np.where(octaves < 0, low, high)
        out_of_reach = np.zeros(len(rows), bool)
        if self.config.level != "high":
            low_end, high_end = _slide_range()
            action = self.dataset.columns["action"][rows]
            slides = _slide(action, octaves * octave_width(), _SLIDE_CONTROLS)[:, _SLIDE_CONTROLS]
            out_of_reach |= ((slides < low_end) | (slides > high_end)).any(axis=1)
        return np.where(off_keyboard | out_of_reach, 0, octaves)


@cache
def _slide_range() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(2,) lowest and highest controls of the slides along the keyboard, right and left [m]."""
    slide = LAYOUT.slide_actuators.start
    hands = both_hands()[::-1]
    return (
        np.array([hand.ctrl_low[slide] for hand in hands]),
        np.array([hand.ctrl_high[slide] for hand in hands]),
    )


def _transpose(keys: NDArray[Any], octaves: NDArray[np.int64]) -> NDArray[Any]:
    """Keys (B, ..., 88) of each sample, moved up by octaves (B,)."""
    moved = keys.copy()
    for number in np.unique(octaves[octaves != 0]):
        which = octaves == number
        moved[which] = np.roll(keys[which], number * OCTAVE, axis=-1)
    return moved


def _along_keyboard(shift: NDArray[np.float32]) -> NDArray[np.float32]:
    """(B, 1, 1, 3) vectors of length (B,) along the keyboard, y [m]."""
    return shift[:, None, None, None] * np.array([0, 1, 0], np.float32)


def _slide(
    values: NDArray[np.float32], shift: NDArray[np.floating], slides: tuple[int, ...]
) -> NDArray[np.float32]:
    """Joints or controls (B, ..., D) with the forearms moved along the keyboard by (B,) [m].

    Args:
        values: joints or controls of both hands.
        shift: (B,) how far.
        slides: places of both slides among these.
    """
    moved = values.copy()
    for slide in slides:
        moved[..., slide] += shift.reshape(-1, *[1] * (values.ndim - 2))
    return moved
