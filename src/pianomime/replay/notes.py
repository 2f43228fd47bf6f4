"""Notes of a replay: those asked for, those heard, and what became of each."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.evaluation.diagnose import Fault, diagnose
from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score, match_notes
from pianomime.plan import FingertipPlan
from pianomime.players.performance import Performance
from pianomime.replay.blocks import json_block
from pianomime.short_repr import count, short_repr

_NOBODY = -1
_MILLISECONDS = 4


@dataclass(frozen=True)
class Judgement:
    """What became of the notes of a performance: N of the score, and E that sounded.

    Attributes:
        played: (N,) bool: notes of the score that a strike stands for.
        note_cause: (N,) why a note was missed, None where it was not or that is not known.
        right: (E,) bool: strikes that stand for a note.
        heard_hand, heard_finger: (E,) who struck, as far as it is known; -1 for nobody.
        heard_cause: (E,) why a strike is wrong, None where it is not or that is not known.
    """

    played: NDArray[np.bool_]
    note_cause: list[str | None]
    right: NDArray[np.bool_]
    heard_hand: list[int]
    heard_finger: list[int]
    heard_cause: list[str | None]

    def __repr__(self) -> str:
        return short_repr(
            self,
            f"{int(self.played.sum())} of {count(len(self.played), 'note')} played",
            f"{int((~self.right).sum())} wrong",
        )

    @classmethod
    def of(cls, performance: Performance) -> Judgement:
        """Judge by the `music` protocol, with causes where there is a plan to tell them from."""
        score, heard, plan = performance.score, performance.played(), performance.plan
        matched = match_notes(score, heard)
        played, right = np.zeros(len(score), bool), np.zeros(len(heard), bool)
        played[matched.wanted] = right[matched.played] = True
        note_cause: list[str | None] = [None] * len(score)
        heard_cause: list[str | None] = [None] * len(heard)
        hand, finger = [_NOBODY] * len(heard), [_NOBODY] * len(heard)
        if plan is not None:
            for note, strike in zip(matched.wanted.tolist(), matched.played.tolist(), strict=True):
                hand[strike] = int(plan.note_hand[note])
                finger[strike] = int(plan.note_finger[note])
            faults = diagnose(performance).faults
            for note in np.flatnonzero(~played).tolist():
                found = _most(fault for fault in faults if fault.missed and fault.note == note)
                note_cause[note] = None if found is None else str(found.cause)
            wrong = [fault for fault in faults if not fault.missed]
            for strike in np.flatnonzero(~right).tolist():
                first, stop = (
                    heard.onset[strike] * FRAME_RATE - 1,
                    heard.offset[strike] * FRAME_RATE,
                )
                found = _most(
                    fault
                    for fault in wrong
                    if fault.key == heard.key[strike]
                    and fault.first < stop
                    and fault.first + fault.frames > first
                )
                if found is not None:
                    heard_cause[strike] = str(found.cause)
                    hand[strike], finger[strike] = found.hand, found.finger
        return cls(played, note_cause, right, hand, finger, heard_cause)


def notes_block(
    score: Score, plan: FingertipPlan | None, judgement: Judgement | None = None
) -> bytes:
    """The block of the notes asked for.

    Args:
        score: the notes.
        plan: who plays them; None if that is not known.
        judgement: what became of them; None while that is not known.
    """
    nobody = [_NOBODY] * len(score)
    return json_block(
        "NOTE",
        {
            "key": score.key.tolist(),
            "onset": _seconds(score.onset),
            "offset": _seconds(score.offset),
            "velocity": score.velocity.tolist(),
            "hand": nobody if plan is None else plan.note_hand.tolist(),
            "finger": nobody if plan is None else plan.note_finger.tolist(),
            "verdict": (
                [None] * len(score)
                if judgement is None
                else ["played" if played else "missed" for played in judgement.played]
            ),
            "cause": [None] * len(score) if judgement is None else judgement.note_cause,
        },
    )


def heard_block(heard: Score, first: int = 0, judgement: Judgement | None = None) -> bytes:
    """A block of notes that sounded.

    Args:
        heard: the notes, from the one numbered `first` on.
        first: replaces what was known from this one on.
        judgement: what became of them, and who struck them; None while that is not known.
    """
    strikes = len(heard)
    columns: dict[str, Any] = {
        "from": first,
        "key": heard.key.tolist(),
        "on": _seconds(heard.onset),
        "off": _seconds(heard.offset),
        "velocity": heard.velocity.tolist(),
        "hand": [_NOBODY] * strikes,
        "finger": [_NOBODY] * strikes,
        "verdict": [None] * strikes,
        "cause": [None] * strikes,
    }
    if judgement is not None:
        columns |= {
            "hand": judgement.heard_hand,
            "finger": judgement.heard_finger,
            "verdict": ["right" if right else "wrong" for right in judgement.right],
            "cause": judgement.heard_cause,
        }
    return json_block("HEAR", columns)


def pedal_block(times: ArrayLike) -> bytes:
    """The block of the sustain pedal.

    Args:
        times: (Q, 2) when it was down [s].
    """
    return json_block("PEDL", {"down": [_seconds(span) for span in np.asarray(times, float)]})


def _most(faults: Any) -> Fault | None:
    """Of some faults, one of the cause that lasted longest."""
    found: list[Fault] = list(faults)
    frames: Counter[str] = Counter()
    for fault in found:
        frames[fault.cause] += fault.frames
    return max(found, key=lambda fault: frames[fault.cause], default=None)


def _seconds(times: NDArray[np.float64]) -> list[float]:
    rounded: list[float] = np.round(times, _MILLISECONDS).tolist()
    return rounded
