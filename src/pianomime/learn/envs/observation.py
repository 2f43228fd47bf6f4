"""What a policy sees: named parts, one after the other in one row of numbers (paper, table 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.learn.expert.config import ObservationConfig
from pianomime.plan import FingertipPlan
from pianomime.world.hand import Hand
from pianomime.world.model import SIDES

_CENTRE = np.array([0.03, 0.0, 0.03])
_REACH = np.array([0.15, 0.6, 0.06])
"""[m] Middle and half the extent of where fingertips are; wrists go a little beyond."""
_FAST = 10.0
"""[rad/s, m/s] Velocities are told in this unit."""
_OFF = 0.05
"""[m] Distances from targets are told in this unit."""
_FRAME = 36


@dataclass(frozen=True)
class Part:
    """One part of an observation.

    Attributes:
        name: as in `ObservationConfig`.
        size: numbers it has.
        unit: what they are before they are normalised.
        scale: how they are normalised.
    """

    name: str
    size: int
    unit: str
    scale: str


def parts(config: ObservationConfig) -> tuple[Part, ...]:
    """The parts that are switched on, in the order in which they stand in an observation."""
    limits = "joint limits to -1 .. 1"
    every = (
        (config.joints, Part("joints", 54, "rad, m", limits)),
        (config.velocities, Part("velocities", 54, "rad/s, m/s", f"divided by {_FAST:g}")),
        (config.keys, Part("keys", KEYS, "share of the way down", "none")),
        (config.goal, Part("goal", KEYS * config.goal, "0 or 1", "none")),
        (
            config.fingertips,
            Part("fingertips", _FRAME * config.fingertips, "m", "the keyboard to -1 .. 1"),
        ),
        (config.prior, Part("prior", 46, "rad, m", "control ranges to -1 .. 1")),
        (config.pedal, Part("pedal", 1, "0 or 1", "none")),
        (config.errors, Part("errors", 30, "m", f"divided by {_OFF:g}")),
        (config.time, Part("time", 1, "share of the song", "none")),
    )
    return tuple(part for wanted, part in every if wanted)


class Observer:
    """Writes observations of a song in place.

    Goals and fingertip targets ahead of the end are those of a silent frame, and of the last.

    Args:
        config: which parts.
        goal: (T, 88) bool.
        plan: of the same frames.
    """

    def __init__(
        self, config: ObservationConfig, goal: NDArray[np.bool_], plan: FingertipPlan
    ) -> None:
        self.parts = parts(config)
        ends = np.cumsum([0, *(part.size for part in self.parts)])
        self.size = int(ends[-1])
        self.slices = {
            part.name: slice(int(first), int(end))
            for part, first, end in zip(self.parts, ends, ends[1:], strict=False)
        }
        hands = [Hand(side) for side in reversed(SIDES)]  # in the order of the joints
        low, high = (
            np.concatenate([getattr(hand, end) for hand in hands]) for end in ("low", "high")
        )
        self._joint_middle, self._joint_half = (low + high) / 2, (high - low) / 2
        low = np.concatenate([hand.ctrl_low for hand in hands])
        high = np.concatenate([hand.ctrl_high for hand in hands])
        self._ctrl_middle, self._ctrl_half = (low + high) / 2, (high - low) / 2
        self._ctrl_width: NDArray[np.float64] = high - low
        self._frames = len(goal)
        silence = np.zeros((max(config.goal, 1), KEYS))
        self._goal = np.vstack([goal, silence]).astype(np.float32)
        self._goal_ahead = np.arange(config.goal)
        targets = plan.fingertips
        self._targets = targets[:, :, 1:]
        scaled = ((targets - _CENTRE) / _REACH).reshape(self._frames, _FRAME)
        self._fingertips = scaled.astype(np.float32)
        self._tips_ahead = np.arange(config.fingertips)

    @property
    def ctrl_range(self) -> NDArray[np.float64]:
        """(46,) width of each actuator's range [rad, m]."""
        return self._ctrl_width

    def write(
        self,
        rows: NDArray[np.float32],
        ids: NDArray[np.int64],
        frames: NDArray[np.int64],
        joints: NDArray[np.float64],
        velocities: NDArray[np.float64],
        keys: NDArray[np.float64],
        tips: NDArray[np.float64],
        prior: NDArray[np.float64],
        pedal: NDArray[np.bool_],
    ) -> None:
        """Write the observations of n environments.

        Args:
            rows: (B, size) where to.
            ids: (n,) which rows.
            frames: (n,) the frame that is to be played next, 0..T.
            joints: (n, 54) right, left [rad, m].
            velocities: (n, 54) the same [rad/s, m/s].
            keys: (n, 88) how far each is down.
            tips: (n, 2, 5, 3) [m] left, right.
            prior: (n, 46) [rad, m].
            pedal: (n,) bool.
        """
        last = np.minimum(frames, self._frames - 1)
        for name, where in self.slices.items():
            if name == "joints":
                values = (joints - self._joint_middle) / self._joint_half
            elif name == "velocities":
                values = velocities / _FAST
            elif name == "keys":
                values = keys
            elif name == "goal":
                ahead = np.minimum(frames[:, None] + self._goal_ahead, len(self._goal) - 1)
                values = self._goal[ahead].reshape(len(ids), -1)
            elif name == "fingertips":
                ahead = np.minimum(frames[:, None] + self._tips_ahead, self._frames - 1)
                values = self._fingertips[ahead].reshape(len(ids), -1)
            elif name == "prior":
                values = (prior - self._ctrl_middle) / self._ctrl_half
            elif name == "pedal":
                values = pedal[:, None]
            elif name == "errors":
                values = ((self._targets[last] - tips) / _OFF).reshape(len(ids), -1)
            else:
                values = (frames / self._frames)[:, None]
            rows[ids, where] = values
