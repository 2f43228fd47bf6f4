"""EnvState: everything that terms of the observation and of the reward are computed from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pianomime.learn.envs.reference import Reference
from pianomime.short_repr import short_repr


@dataclass(frozen=True, eq=False)
class EnvState:
    """State of n environments of one song at one instant; all arrays have n rows.

    A term must not write into these arrays.

    Attributes:
        reference: goals, pedal and plan of the whole song, for terms that look ahead.
        frames: (n,) the frame that `goal`, `targets` and `pedal_goal` are of. For a reward term
            it is the frame that was just played, for an observation term the one that is played
            next (T when the song is over).
        joints: (n, 54) joint positions of the hands, right then left [rad, m].
        velocities: (n, 54) joint velocities in the same order [rad/s, m/s].
        key_state: (n, 88) how far each key is down, 0..1.
        pressed: (n, 88) bool, the keys that sound.
        tips: (n, 2, 5, 3) fingertips, hands (left, right), thumb first [m], world frame.
        pedal: (n,) bool, whether the pedal is down.
        base_control: (n, 46) control that the base controller proposes for the next frame
            [rad, m].
        action: (n, A) the last action, -1..1; zeros at the beginning of an episode.
    """

    reference: Reference
    frames: NDArray[np.int64]
    joints: NDArray[np.float64]
    velocities: NDArray[np.float64]
    key_state: NDArray[np.float64]
    pressed: NDArray[np.bool_]
    tips: NDArray[np.float64]
    pedal: NDArray[np.bool_]
    base_control: NDArray[np.float64]
    action: NDArray[np.float64]

    __repr__ = short_repr

    def __len__(self) -> int:
        """Number of environments, n."""
        return len(self.frames)

    @cached_property
    def goal(self) -> NDArray[np.bool_]:
        """(n, 88) bool, the keys that should sound; silence when the song is over."""
        return self.reference.goals(self.frames)

    @cached_property
    def pedal_goal(self) -> NDArray[np.bool_]:
        """(n,) bool, whether the pedal should be down; that of the last frame at the end."""
        return self.reference.pedal[np.minimum(self.frames, len(self.reference) - 1)]

    @cached_property
    def targets(self) -> NDArray[np.float64]:
        """(n, 2, 5, 3) the plan's targets of the fingertips, ordered as `tips` [m]."""
        return self.reference.targets(self.frames)[:, :, 1:]

    def goals_ahead(self, count: int) -> NDArray[np.bool_]:
        """(n, count, 88) bool, the goals of `frames` and of those after them."""
        return self.reference.goals(self.frames[:, None] + np.arange(count))

    def targets_ahead(self, count: int) -> NDArray[np.float64]:
        """(n, count, 2, 6, 3) targets of wrists and fingertips, of `frames` and after [m]."""
        return self.reference.targets(self.frames[:, None] + np.arange(count))
