"""Why notes went wrong: every missed and wrong note of a performance with its cause."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from pianomime.performance import Performance
from pianomime.plan import NO_KEY
from pianomime.world.figures import key_centres, key_half_sizes
from pianomime.world.hand import SIDES, Hand

_NOBODY = -1
# A finger this much further from a key's middle than the key's edge still presses it [m].
_OVERLAP = 0.003
# A key less than this share of the way down has not been touched.
_TOUCHED = 0.05
# Frames after the physics broke that are put down to it: the hands take so long to come back.
_AFTERMATH = 10


class Cause(StrEnum):
    """Why a key was up when it should have been down, or down when it should have been up."""

    BROKEN = "physics broke"
    NOT_PLANNED = "not planned"
    PLANNED_ASIDE = "planned beside the key"
    BESIDE = "finger beside its key"
    ABOVE = "finger above its key"
    LATE = "pressed late"
    SHALLOW = "pressed too shallow"
    EARLY = "pressed early"
    RELEASED_LATE = "released late"
    NEIGHBOUR = "neighbour hit by a pressing finger"
    IDLE = "hit by an idle finger"
    UNKNOWN = "hit by something else"


@dataclass(frozen=True)
class Fault:
    """A run of frames in which one key was wrong for one cause.

    Attributes:
        missed: True for a key that should have been down, False for one that should not.
        key: 0..87.
        first, frames: when, and for how long [0.05 s frames].
        cause: why.
        hand, finger: 0 left or 1 right, and 0 thumb .. 4 little, of the finger to blame; -1 for
            none.
    """

    missed: bool
    key: int
    first: int
    frames: int
    cause: Cause
    hand: int
    finger: int


def explain(performance: Performance) -> list[Fault]:
    """Every fault of a performance, in order of time.

    Args:
        performance: one with a fingertip plan.

    Raises:
        ValueError: the performance has no plan to compare with.
    """
    if performance.plan is None:
        raise ValueError("a performance without a fingertip plan cannot be explained")
    scene = _Scene.of(performance)
    faults = []
    for missed, cells in (
        (True, scene.wanted & ~performance.pressed),
        (False, performance.pressed & ~scene.wanted),
    ):
        judge = scene.why_missed if missed else scene.why_wrong
        for key in np.flatnonzero(cells.any(axis=0)):
            run: Fault | None = None
            for frame in np.flatnonzero(cells[:, key]):
                cause, hand, finger = judge(int(frame), int(key))
                same = (
                    run is not None
                    and run.first + run.frames == frame
                    and (run.cause, run.hand, run.finger) == (cause, hand, finger)
                )
                if run is not None and same:
                    run = Fault(missed, run.key, run.first, run.frames + 1, cause, hand, finger)
                    faults[-1] = run
                else:
                    run = Fault(missed, int(key), int(frame), 1, cause, hand, finger)
                    faults.append(run)
    return sorted(faults, key=lambda fault: (fault.first, fault.key))


def frames_by_cause(faults: list[Fault], missed: bool) -> dict[Cause, int]:
    """Key-frames lost to each cause, the costliest first."""
    count: Counter[Cause] = Counter()
    for fault in faults:
        if fault.missed == missed:
            count[fault.cause] += fault.frames
    return dict(count.most_common())


@dataclass(frozen=True, eq=False)
class _Scene:
    """What is known of each frame.

    Attributes:
        wanted: (T, 88) bool.
        pressed: (T, 88) bool.
        key_state: (T, 88) 0..1.
        finger_key: (T, 2, 5) the key each finger was to press.
        planned: (T, 2, 5) [m] where along the keyboard each fingertip was to be.
        tips: (T, 2, 5, 3) [m] where the fingertips were at the end of each frame.
        broken: (T,) bool, in the aftermath of broken physics.
    """

    wanted: NDArray[np.bool_]
    pressed: NDArray[np.bool_]
    key_state: NDArray[np.float64]
    finger_key: NDArray[np.int8]
    planned: NDArray[np.float64]
    tips: NDArray[np.float64]
    broken: NDArray[np.bool_]

    @classmethod
    def of(cls, performance: Performance) -> _Scene:
        plan = performance.plan
        assert plan is not None
        tips = np.empty((len(performance), 2, 5, 3))
        for index, side in enumerate(SIDES):
            hand = Hand(side)
            for frame, qpos in enumerate(performance.qpos):
                tips[frame, index] = hand.points(qpos[hand.joints])[1:]
        broken = np.zeros(len(performance), bool)
        for frame in performance.blow_ups:
            broken[frame : frame + _AFTERMATH] = True
        return cls(
            performance.score.roll(),
            performance.pressed,
            performance.key_state,
            plan.finger_key,
            plan.fingertips[:, :, 1:, 1],
            tips,
            broken,
        )

    def why_missed(self, frame: int, key: int) -> tuple[Cause, int, int]:
        """Cause, hand and finger for a key that should have been down."""
        fingers = np.argwhere(self.finger_key[frame] == key)
        if self.broken[frame]:
            return Cause.BROKEN, _NOBODY, _NOBODY
        if not len(fingers):
            return Cause.NOT_PLANNED, _NOBODY, _NOBODY
        hand, finger = (int(index) for index in fingers[0])
        edge = key_half_sizes()[key, 1] + _OVERLAP
        along = key_centres()[key, 1]
        if abs(self.planned[frame, hand, finger] - along) > edge:
            return Cause.PLANNED_ASIDE, hand, finger
        if abs(self.tips[frame, hand, finger, 1] - along) > edge:
            return Cause.BESIDE, hand, finger
        if self.key_state[frame, key] < _TOUCHED:
            return Cause.ABOVE, hand, finger
        begins = frame == 0 or self.finger_key[frame - 1, hand, finger] != key
        return (Cause.LATE if begins else Cause.SHALLOW), hand, finger

    def why_wrong(self, frame: int, key: int) -> tuple[Cause, int, int]:
        """Cause, hand and finger for a key that should have been up."""
        if self.broken[frame]:
            return Cause.BROKEN, _NOBODY, _NOBODY
        hand, finger = self._nearest(frame, key)
        if self._held_on(frame, key):
            return Cause.RELEASED_LATE, hand, finger
        if frame + 1 < len(self.wanted) and self.wanted[frame + 1, key]:
            return Cause.EARLY, hand, finger
        if hand == _NOBODY:
            return Cause.UNKNOWN, hand, finger
        idle = self.finger_key[frame, hand, finger] == NO_KEY
        return (Cause.IDLE if idle else Cause.NEIGHBOUR), hand, finger

    def _held_on(self, frame: int, key: int) -> bool:
        """Whether the key has been down without a break since it was wanted."""
        while frame > 0 and self.pressed[frame, key] and not self.wanted[frame, key]:
            frame -= 1
        return bool(self.pressed[frame, key] and self.wanted[frame, key])

    def _nearest(self, frame: int, key: int) -> tuple[int, int]:
        """The fingertip over a key, or touching it from the side; -1, -1 for none."""
        tips = self.tips[frame]
        beside = np.abs(tips[..., 1] - key_centres()[key, 1])
        ahead = np.abs(tips[..., 0] - key_centres()[key, 0]) - key_half_sizes()[key, 0]
        reaches = (beside < key_half_sizes()[key, 1] + 0.012) & (ahead < 0.02)
        if not reaches.any():
            return _NOBODY, _NOBODY
        hand, finger = np.unravel_index(np.argmin(np.where(reaches, beside, np.inf)), beside.shape)
        return int(hand), int(finger)
