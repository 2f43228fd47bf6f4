"""Diagnosis of a performance: the cause of every missed and every wrong key."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import NO_KEY
from pianomime.players.performance import Performance
from pianomime.schema import Field, Schema
from pianomime.short_repr import count, short_repr
from pianomime.world.hand import Hand
from pianomime.world.layout import FINGER_COUNT
from pianomime.world.model import SIDES
from pianomime.world.parameters import key_centres, key_half_sizes

NOBODY = -1
"""Marks that there is no hand, no finger or no note."""

_OVERLAP = 0.003
"""[m] A finger whose centre is this far beyond the edge of a key still presses it."""
_TOUCHED = 0.05
"""A key that is down by a smaller share of its way has not been touched."""
_TOUCH = 0.013
"""[m] A fingertip whose site is further from the box of a key at rest does not press it: the
fingertip reaches 8.5 mm below its site and at most 12 mm around it."""
_MOST_EARLY = 4
"""Frames before a note in which its key may go down and still be meant for it."""
_AFTERMATH = 10
"""Frames after unstable physics whose faults are blamed on it: the hands need them to return."""


class Cause(StrEnum):
    """Why a key was up when it should have been down, or down when it should have been up.

    The values are the labels in tables and pictures.
    """

    BROKEN = "physics broke"
    NOT_PLANNED = "not planned"
    PLANNED_ASIDE = "planned beside the key"
    BESIDE = "finger beside its key"
    ABOVE = "finger above its key"
    LATE = "pressed late"
    SHALLOW = "pressed too shallow"
    PLANNED_WRONG = "planned, not wanted"
    EARLY = "pressed early"
    RELEASED_LATE = "released late"
    NEIGHBOUR = "hit by a pressing finger"
    IDLE = "hit by an idle finger"
    NO_TIP = "down without a fingertip"


@dataclass(frozen=True)
class Fault:
    """A run of frames in which one key was missed or wrong for one cause.

    Attributes:
        missed: True for a key that should have been down, False for one that should have been up.
        key: the key, 0..87.
        first: first frame.
        frames: number of frames.
        cause: the cause.
        hand: hand of the finger to blame, 0 left, 1 right, -1 for none.
        finger: finger to blame, 0 thumb .. 4 little, -1 for none.
        note: index of the note of the score that was missed; -1 for a wrong key.
    """

    missed: bool
    key: int
    first: int
    frames: int
    cause: Cause
    hand: int
    finger: int
    note: int


@dataclass(frozen=True)
class Diagnosis:
    """All faults of one performance.

    A key-frame is one key in one frame, a cell of the piano roll.

    Attributes:
        song: title of the score.
        player: name of the player.
        wanted: number of key-frames in which a key should be down.
        faults: in order of time; their frames add up to all key-frames missed and wrong.
    """

    song: str
    player: str
    wanted: int
    faults: list[Fault]

    def __repr__(self) -> str:
        frames = sum(fault.frames for fault in self.faults)
        return short_repr(
            self,
            repr(self.song),
            f"player {self.player!r}",
            count(len(self.faults), "fault"),
            f"{frames} of {self.wanted} frames",
        )


@dataclass(frozen=True)
class Total:
    """Sum of the faults of one cause.

    Attributes:
        missed: True for keys that should have been down, False for keys that should have been up.
        cause: the cause.
        frames: number of key-frames missed or wrong.
        share: `frames` as a share of the key-frames wanted.
        notes: number of notes missed in part or whole, or of wrong presses.
        hand: hand of the finger to blame for most of these frames, as in `Fault`.
        finger: finger to blame for most of these frames, as in `Fault`.
    """

    missed: bool
    cause: Cause
    frames: int
    share: float
    notes: int
    hand: int
    finger: int


def diagnose(performance: Performance) -> Diagnosis:
    """Find the cause of every missed and every wrong key of a performance.

    Plan, fingertips and keys of each frame are compared in a fixed order of rules; the first cause
    that applies is reported.

    Args:
        performance: a performance with a fingertip plan.

    Raises:
        ValueError: the performance has no plan.
    """
    scene = _Scene.of(performance)
    faults = []
    for missed, cells, judge in (
        (True, scene.wanted & ~scene.pressed, scene.why_missed),
        (False, scene.pressed & ~scene.wanted, scene.why_wrong),
    ):
        for key in np.flatnonzero(cells.any(axis=0)).tolist():
            judged = [
                (frame, (*judge(frame, key), int(scene.note[frame, key])))
                for frame in np.flatnonzero(cells[:, key]).tolist()
            ]
            # In an unbroken run, frame minus place in the list is constant.
            places = groupby(enumerate(judged), lambda item: (item[1][0] - item[0], item[1][1]))
            for (_, (cause, hand, finger, note)), group in places:
                frames = [frame for _, (frame, _) in group]
                faults.append(Fault(missed, key, frames[0], len(frames), cause, hand, finger, note))
    faults.sort(key=lambda fault: (fault.first, fault.key))
    wanted = int(scene.wanted.sum())
    return Diagnosis(performance.score.title, performance.player, wanted, faults)


def totals(diagnoses: Iterable[Diagnosis]) -> list[Total]:
    """Sum the faults of all performances by cause, the most frames first.

    Args:
        diagnoses: of any number of performances.
    """
    frames: Counter[tuple[bool, Cause]] = Counter()
    fingers: dict[tuple[bool, Cause], Counter[tuple[int, int]]] = {}
    notes: dict[tuple[bool, Cause], set[tuple[int, int, int]]] = {}
    wanted = 0
    for song, diagnosis in enumerate(diagnoses):
        wanted += diagnosis.wanted
        for place, fault in enumerate(diagnosis.faults):
            kind = fault.missed, fault.cause
            frames[kind] += fault.frames
            fingers.setdefault(kind, Counter())[fault.hand, fault.finger] += fault.frames
            # A note that is missed several times counts once; every wrong press counts.
            note = (fault.note, NOBODY) if fault.missed else (NOBODY, place)
            notes.setdefault(kind, set()).add((song, *note))
    return [
        Total(
            *kind,
            frames=count,
            share=count / max(wanted, 1),
            notes=len(notes[kind]),
            hand=fingers[kind].most_common(1)[0][0][0],
            finger=fingers[kind].most_common(1)[0][0][1],
        )
        for kind, count in frames.most_common()
    ]


_FRAMES: dict[str, Schema] = {cause.value: Field("int", (), 1, optional=True) for cause in Cause}
CAUSES_SCHEMA: dict[str, Schema] = {
    "wanted": Field("int", (), 0),
    "missed": _FRAMES,
    "wrong": _FRAMES,
}
"""Schema of `frames_by_cause`."""


def frames_by_cause(diagnosis: Diagnosis) -> dict[str, int | dict[str, int]]:
    """Key-frames `wanted`, and those `missed` and `wrong` by cause, the most first.

    Args:
        diagnosis: of one performance.
    """
    sums = totals([diagnosis])
    return {
        "wanted": diagnosis.wanted,
        "missed": {total.cause.value: total.frames for total in sums if total.missed},
        "wrong": {total.cause.value: total.frames for total in sums if not total.missed},
    }


@dataclass(frozen=True, eq=False)
class _Scene:
    """Plan, fingertips and keys of each of T frames.

    Attributes:
        wanted: (T, 88) bool, keys that should be down.
        pressed: (T, 88) bool, keys that are down.
        key_state: (T, 88) how far each key is down, 0..1.
        note: (T, 88) index of the note of the score that holds a key down, -1 for none.
        finger_key: (T, 2, 5) key that each finger should press.
        planned: (T, 2, 5) target of each fingertip along the keyboard, world y [m].
        tips: (T, 2, 5, 3) fingertips at the end of each frame, world frame [m].
        broken: (T,) bool, frames shortly after unstable physics.
    """

    wanted: NDArray[np.bool_]
    pressed: NDArray[np.bool_]
    key_state: NDArray[np.float64]
    note: NDArray[np.int32]
    finger_key: NDArray[np.int8]
    planned: NDArray[np.float64]
    tips: NDArray[np.float64]
    broken: NDArray[np.bool_]

    @classmethod
    def of(cls, performance: Performance) -> _Scene:
        plan, score = performance.plan, performance.score
        if plan is None:
            raise ValueError("a performance without a fingertip plan cannot be diagnosed")
        tips = np.empty((len(performance), 2, FINGER_COUNT, 3))
        for index, side in enumerate(SIDES):
            hand = Hand(side)
            tips[:, index] = hand.points_along(performance.qpos[:, hand.joints])[:, 1:]
        broken = np.zeros(len(performance), bool)
        for frame in performance.blow_ups:
            broken[frame : frame + _AFTERMATH] = True
        note = np.full(performance.pressed.shape, NOBODY, np.int32)
        for index, (first, stop) in enumerate(score.note_frames()):
            note[first:stop, score.key[index]] = index
        return cls(
            wanted=score.roll(),
            pressed=performance.pressed,
            key_state=performance.key_state,
            note=note,
            finger_key=plan.finger_key,
            planned=plan.fingertips[:, :, 1:, 1],
            tips=tips,
            broken=broken,
        )

    def why_missed(self, frame: int, key: int) -> tuple[Cause, int, int]:
        """Cause, hand and finger for a key that should have been down."""
        fingers = np.argwhere(self.finger_key[frame] == key).tolist()
        # What was not planned would have been missed with stable physics, too.
        if not fingers:
            return Cause.NOT_PLANNED, NOBODY, NOBODY
        if self.broken[frame]:
            return Cause.BROKEN, NOBODY, NOBODY
        hand, finger = fingers[0]
        edge = key_half_sizes()[key, 1] + _OVERLAP
        along = key_centres()[key, 1]
        if abs(self.planned[frame, hand, finger] - along) > edge:
            return Cause.PLANNED_ASIDE, hand, finger
        if abs(self.tips[frame, hand, finger, 1] - along) > edge:
            return Cause.BESIDE, hand, finger
        if self._is_late(frame, key, hand, finger):
            return Cause.LATE, hand, finger
        above = self.key_state[frame, key] < _TOUCHED
        return (Cause.ABOVE if above else Cause.SHALLOW), hand, finger

    def _is_late(self, frame: int, key: int, hand: int, finger: int) -> bool:
        """Whether the key goes down later in this press, or just after it, but not before."""
        at_it = self.finger_key[:, hand, finger] == key
        first = last = frame
        while first > 0 and at_it[first - 1]:
            first -= 1
        while last + 1 < len(at_it) and at_it[last + 1]:
            last += 1
        before, after = self.pressed[first:frame, key], self.pressed[frame + 1 : last + 2, key]
        return bool(after.any() and not before.any())

    def why_wrong(self, frame: int, key: int) -> tuple[Cause, int, int]:
        """Cause, hand and finger for a key that should have been up."""
        if self.broken[frame]:
            return Cause.BROKEN, NOBODY, NOBODY
        fingers = np.argwhere(self.finger_key[frame] == key).tolist()
        if fingers:
            hand, finger = fingers[0]
            return Cause.PLANNED_WRONG, hand, finger
        hand, finger = self._nearest(frame, key)
        if hand == NOBODY:
            return Cause.NO_TIP, hand, finger
        if self._down_since_wanted(frame, key):
            return Cause.RELEASED_LATE, hand, finger
        if self._down_until_wanted(frame, key):
            return Cause.EARLY, hand, finger
        idle = self.finger_key[frame, hand, finger] == NO_KEY
        return (Cause.IDLE if idle else Cause.NEIGHBOUR), hand, finger

    def _down_since_wanted(self, frame: int, key: int) -> bool:
        """Whether the key has been down without interruption since it was last wanted."""
        while frame > 0 and self.pressed[frame, key] and not self.wanted[frame, key]:
            frame -= 1
        return bool(self.pressed[frame, key] and self.wanted[frame, key])

    def _down_until_wanted(self, frame: int, key: int) -> bool:
        """Whether the key is wanted soon, and stays down until then."""
        soon = self.wanted[frame + 1 : frame + 1 + _MOST_EARLY, key]
        return bool(soon.any() and self.pressed[frame : frame + 2 + soon.argmax(), key].all())

    def _nearest(self, frame: int, key: int) -> tuple[int, int]:
        """Hand and finger that press a key, or touch it from the side; -1, -1 for none."""
        outside = np.abs(self.tips[frame] - key_centres()[key]) - key_half_sizes()[key]
        distance = np.linalg.norm(np.maximum(outside, 0.0), axis=-1)
        if distance.min() > _TOUCH:
            return NOBODY, NOBODY
        hand, finger = np.unravel_index(np.argmin(distance), distance.shape)
        return int(hand), int(finger)
