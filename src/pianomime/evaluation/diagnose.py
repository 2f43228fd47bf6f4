"""Why notes went wrong: every missed and wrong note of a performance with its cause."""

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
from pianomime.world.hand import Hand
from pianomime.world.model import SIDES
from pianomime.world.parameters import key_centres, key_half_sizes

NOBODY = -1
"""Stands for no hand, no finger or no note."""

# A finger this much further from a key's middle than the key's edge still presses it [m].
_OVERLAP = 0.003
# A key less than this share of the way down has not been touched.
_TOUCHED = 0.05
# A fingertip whose site is further than this from a key's box at rest does not press it [m]: its
# flesh is 8.5 mm thick below the site and at most 12 mm around it.
_TOUCH = 0.013
# A key that goes down longer before its note than this was not meant for it [frames].
_MOST_EARLY = 4
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
    PLANNED_WRONG = "planned, not wanted"
    EARLY = "pressed early"
    RELEASED_LATE = "released late"
    NEIGHBOUR = "hit by a pressing finger"
    IDLE = "hit by an idle finger"
    NO_TIP = "down without a fingertip"


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
        note: the note of the score that was missed; -1 for a wrong key.
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
    """Everything that went wrong in one performance.

    Attributes:
        song: title of the score.
        player: who played.
        wanted: key-frames that the score asks for: cells of its roll.
        faults: in order of time; their frames add up to the cells that were missed and wrong.
    """

    song: str
    player: str
    wanted: int
    faults: list[Fault]


@dataclass(frozen=True)
class Total:
    """What one cause cost.

    Attributes:
        missed: whether keys were up that should have been down, or the other way round.
        cause: why.
        frames: key-frames lost.
        share: of the key-frames wanted.
        notes: notes of the score that were missed in part or whole, or wrong presses.
        hand, finger: who is to blame for most of it, as in Fault.
    """

    missed: bool
    cause: Cause
    frames: int
    share: float
    notes: int
    hand: int
    finger: int


def diagnose(performance: Performance) -> Diagnosis:
    """Find the cause of every fault of a performance.

    Args:
        performance: one with a fingertip plan.

    Raises:
        ValueError: the performance has no plan to compare with.
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
            # In an unbroken run, the frame less its place in the list stays the same.
            places = groupby(enumerate(judged), lambda item: (item[1][0] - item[0], item[1][1]))
            for (_, (cause, hand, finger, note)), group in places:
                frames = [frame for _, (frame, _) in group]
                faults.append(Fault(missed, key, frames[0], len(frames), cause, hand, finger, note))
    faults.sort(key=lambda fault: (fault.first, fault.key))
    wanted = int(scene.wanted.sum())
    return Diagnosis(performance.score.title, performance.player, wanted, faults)


def totals(diagnoses: Iterable[Diagnosis]) -> list[Total]:
    """What each cause cost over all performances together, the costliest first."""
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
            # A missed note counts once, however often it was lost; a wrong press is its own.
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


def frames_by_cause(diagnosis: Diagnosis) -> dict[str, int | dict[str, int]]:
    """The key-frames `wanted`, and those `missed` and `wrong` by cause, the costliest first."""
    sums = totals([diagnosis])
    return {
        "wanted": diagnosis.wanted,
        "missed": {total.cause.value: total.frames for total in sums if total.missed},
        "wrong": {total.cause.value: total.frames for total in sums if not total.missed},
    }


@dataclass(frozen=True, eq=False)
class _Scene:
    """What is known of each frame.

    Attributes:
        wanted: (T, 88) bool.
        pressed: (T, 88) bool.
        key_state: (T, 88) 0..1.
        note: (T, 88) the note of the score that wants a key, -1 for none.
        finger_key: (T, 2, 5) the key each finger was to press.
        planned: (T, 2, 5) [m] where along the keyboard each fingertip was to be.
        tips: (T, 2, 5, 3) [m] where the fingertips were at the end of each frame.
        broken: (T,) bool, in the aftermath of broken physics.
    """

    wanted: NDArray[np.bool_]
    pressed: NDArray[np.bool_]
    key_state: NDArray[np.float64]
    note: NDArray[np.int64]
    finger_key: NDArray[np.int8]
    planned: NDArray[np.float64]
    tips: NDArray[np.float64]
    broken: NDArray[np.bool_]

    @classmethod
    def of(cls, performance: Performance) -> _Scene:
        plan, score = performance.plan, performance.score
        if plan is None:
            raise ValueError("a performance without a fingertip plan cannot be diagnosed")
        tips = np.empty((len(performance), 2, 5, 3))
        for index, side in enumerate(SIDES):
            hand = Hand(side)
            for frame, qpos in enumerate(performance.qpos):
                tips[frame, index] = hand.points(qpos[hand.joints])[1:]
        broken = np.zeros(len(performance), bool)
        for frame in performance.blow_ups:
            broken[frame : frame + _AFTERMATH] = True
        note = np.full(performance.pressed.shape, NOBODY)
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
        # What was not planned would have been missed by sound physics too.
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
        """Whether the key has been down without a break since it was wanted."""
        while frame > 0 and self.pressed[frame, key] and not self.wanted[frame, key]:
            frame -= 1
        return bool(self.pressed[frame, key] and self.wanted[frame, key])

    def _down_until_wanted(self, frame: int, key: int) -> bool:
        """Whether the key soon is wanted, and stays down until then."""
        soon = self.wanted[frame + 1 : frame + 1 + _MOST_EARLY, key]
        return bool(soon.any() and self.pressed[frame : frame + 2 + soon.argmax(), key].all())

    def _nearest(self, frame: int, key: int) -> tuple[int, int]:
        """The fingertip that presses a key, or touches it from the side; -1, -1 for none."""
        outside = np.abs(self.tips[frame] - key_centres()[key]) - key_half_sizes()[key]
        distance = np.linalg.norm(np.maximum(outside, 0.0), axis=-1)
        if distance.min() > _TOUCH:
            return NOBODY, NOBODY
        hand, finger = np.unravel_index(np.argmin(distance), distance.shape)
        return int(hand), int(finger)
