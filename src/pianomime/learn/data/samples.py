"""Samples of clips: what a network is given in one frame, and what it should have said."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.learn.data.clips import Clips
from pianomime.learn.imitation.config import PolicyConfig
from pianomime.policies.features import (
    TIPS,
    Arrays,
    base,
    from_wrists,
    high_inputs,
    low_inputs,
    octave,
    rest_tips,
)
from pianomime.policies.horizon import CHUNK, HIGH_GOALS
from pianomime.world.hand import both_hands, hand_points
from pianomime.world.layout import LAYOUT

_OCTAVE = 12
_SLIDES = (0, LAYOUT.hand_joints)
"""Joints that carry the forearms along the keyboard, right and left; y rises as they do."""
_SLIDE_CONTROLS = (20, 43)


@dataclass(frozen=True, eq=False)
class Windows:
    """Draws samples.

    Attributes:
        clips: from what.
        config: for which stage.
        tips: (T, 2, 6, 3) where the points were before each frame [m]: those of the joints, or of
            the frame before.
    """

    clips: Clips
    config: PolicyConfig
    tips: NDArray[np.float32]

    @classmethod
    def of(cls, clips: Clips, config: PolicyConfig) -> Windows:
        """Prepare samples of clips for a stage."""
        if config.level == "high":
            tips = np.roll(clips.columns["fingertips"], 1, axis=0)
            tips[clips.starts] = rest_tips()
        else:
            tips = hand_points(clips.columns["joints"])
        return cls(clips, config, tips.astype(np.float32))

    def __len__(self) -> int:
        """Number of samples: one a frame."""
        return int(self.clips.ends[-1])

    def draw(self, draw: np.random.Generator, batch: int) -> Arrays:
        """Samples by chance: each frame alike often, in a key by chance where that is asked for."""
        rows = draw.integers(0, len(self), batch)
        shift = draw.integers(-1, 2, batch) if self.config.transpose else np.zeros(batch, np.int64)
        sample = self._absolute(rows, shift)
        if self.config.level == "high":
            noise = draw.normal(0.0, self.config.tip_noise, (batch, 2, 6, 3))
            noise[:, :, 0, 1] += draw.normal(0.0, self.config.hand_noise, (batch, 2))
            sample["vector"] += noise.reshape(batch, TIPS).astype(np.float32)
        elif self.config.level == "low":
            # Alike in all frames of a chunk, and in where they are and how far that is off.
            noise = draw.normal(0.0, self.config.target_noise, (batch, 1, 1, 12, 3))
            frames = sample["frames"].reshape(batch, CHUNK, 2, 12, 3)
            noise = noise * (frames[:, :, :1, :, 2:] > 0.0) * [1.0, 1.0, 0.0]
            sample["frames"] = (frames + noise).reshape(batch, CHUNK, -1).astype(np.float32)
        return self._relative(sample)

    def some(self, number: int) -> Arrays:
        """So many samples, evenly spread, as they are."""
        rows = np.linspace(0, len(self) - 1, min(number, len(self))).astype(np.int64)
        return self.sample(rows, np.zeros(len(rows), np.int64))

    def sample(self, rows: NDArray[np.int64], octaves: NDArray[np.int64]) -> Arrays:
        """What is given in frames (B,), and as `target` (B, T, D) what should be said.

        The target is relative to `base`. Beyond the end of a clip its last frame is held, and its
        goals are silence.

        Args:
            rows: (B,) frames.
            octaves: (B,) by how many everything is moved up; where that leads off the keyboard, or
                controls beyond what the forearms can reach, it stays.
        """
        return self._relative(self._absolute(rows, octaves))

    def _relative(self, sample: Arrays) -> Arrays:
        config = self.config
        target = sample["target"] - base(config.level, config.prior, sample["vector"])
        return {**sample, "target": target[:, : config.chunk].astype(np.float32)}

    def _absolute(self, rows: NDArray[np.int64], octaves: NDArray[np.int64]) -> Arrays:
        """As `sample`, with a target that is not relative to anything."""
        columns, config = self.clips.columns, self.config
        end = self.clips.ends[np.searchsorted(self.clips.ends, rows, side="right")]
        ahead = rows[:, None] + np.arange(HIGH_GOALS if config.level == "high" else CHUNK)
        inside = ahead < end[:, None]
        goal = columns["goal"][np.minimum(ahead, end[:, None] - 1)] & inside[..., None]
        chunk = np.minimum(rows[:, None] + np.arange(CHUNK), end[:, None] - 1)
        targets = columns["fingertips"][chunk]
        octaves = self._possible(rows, goal, octaves)
        off = (octaves * octave()).astype(np.float32)
        goal = _moved(goal, octaves)
        targets = targets + _along(off)[:, None]
        tips = self.tips[rows] + _along(off)
        if config.level == "high":
            told = from_wrists(targets).reshape(len(rows), CHUNK, TIPS)
            return {**high_inputs(goal, tips), "target": told}
        joints, prior, action = columns["joints"][rows], None, columns["action"][chunk]
        joints = _slid(joints, off, _SLIDES)
        action = _slid(action, off, _SLIDE_CONTROLS)
        if config.prior:
            priors = _slid(columns["prior"][chunk], off, _SLIDE_CONTROLS)
            prior, action = priors[:, 0], action - priors
        sample = low_inputs(
            goal,
            targets if config.level == "low" else None,
            tips,
            joints,
            columns["velocities"][rows],
            _moved(columns["keys"][rows], octaves),
            prior,
        )
        return {**sample, "target": action}

    def _possible(
        self, rows: NDArray[np.int64], goal: NDArray[np.bool_], octaves: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """The octaves (B,) by which each sample can be moved."""
        used = np.asarray(goal.any(axis=1))
        if self.config.level != "high":
            used = used | (self.clips.columns["keys"][rows] > 0)
        low, high = used[:, :_OCTAVE].any(axis=1), used[:, KEYS - _OCTAVE :].any(axis=1)
        off_keys = np.where(octaves < 0, low, high)
        beyond = np.zeros(len(rows), bool)
        if self.config.level != "high":
            low_end, high_end = _slide_ends()
            action = _slid(self.clips.columns["action"][rows], octaves * octave(), _SLIDE_CONTROLS)
            slides = action[:, _SLIDE_CONTROLS]
            beyond |= ((slides < low_end) | (slides > high_end)).any(axis=1)
        return np.where(off_keys | beyond, 0, octaves)


@cache
def _slide_ends() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(2,) least and most of the controls that carry the forearms along [m]."""
    hands = both_hands()[::-1]
    low, high = (
        np.array([getattr(hand, end)[_SLIDE_CONTROLS[0]] for hand in hands])
        for end in ("ctrl_low", "ctrl_high")
    )
    return low, high


def _moved(keys: NDArray[Any], octaves: NDArray[np.int64]) -> NDArray[Any]:
    """Keys (B, ..., 88) of each sample, moved by octaves (B,)."""
    moved = keys.copy()
    for octave_count in np.unique(octaves[octaves != 0]):
        which = octaves == octave_count
        moved[which] = np.roll(keys[which], octave_count * _OCTAVE, axis=-1)
    return moved


def _along(off: NDArray[np.float32]) -> NDArray[np.float32]:
    """(B, 1, 1, 3) that moves points by (B,) along the keyboard [m]."""
    return off[:, None, None, None] * np.array([0, 1, 0], np.float32)


def _slid(
    values: NDArray[np.float32], off: NDArray[np.floating], slides: tuple[int, int]
) -> NDArray[np.float32]:
    """Joints or controls (B, ..., D) of forearms that are moved along the keyboard by (B,) [m]."""
    moved = values.copy()
    for slide in slides:
        moved[..., slide] += off.reshape(-1, *[1] * (values.ndim - 2))
    return moved
