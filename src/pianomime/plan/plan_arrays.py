"""A Score and a FingertipPlan as arrays of an .npz file, and the schema of these."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS, NO_KEY
from pianomime.music import Score
from pianomime.music.score import MAX_SECONDS
from pianomime.plan.fingertip_plan import FingertipPlan
from pianomime.schema import Field
from pianomime.world.layout import FINGER_COUNT, POINT_COUNT

_FARTHEST = 10.0
"""[m] World frame; the keyboard is 1.2 m long."""

SCORE_SCHEMA = {
    "score_title": Field("text"),
    "score_key": Field("int", ("N",), 0, KEYS - 1),
    "score_onset": Field("float", ("N",), 0, MAX_SECONDS),
    "score_offset": Field("float", ("N",), 0, MAX_SECONDS),
    "score_velocity": Field("int", ("N",), 1, 127),
    "score_pedal": Field("float", ("P", 2), 0, MAX_SECONDS),
    "score_remarks": Field("text", ("R",), optional=True),
}
"""The arrays of a score of N notes and P pedal intervals, of which R remarks were made."""

FINGERTIPS = Field("float", ("T", 2, POINT_COUNT, 3), -_FARTHEST, _FARTHEST)
"""Points of both hands in T frames [m]."""
FINGER_KEY = Field("int", ("T", 2, FINGER_COUNT), NO_KEY, KEYS - 1)
"""The key that each finger presses in T frames."""

PLAN_SCHEMA = {
    "plan_fingertips": FINGERTIPS,
    "plan_finger_key": FINGER_KEY,
    "plan_note_hand": Field("int", ("N",), -1, 1),
    "plan_note_finger": Field("int", ("N",), -1, FINGER_COUNT - 1),
}
"""The arrays of a plan of T frames for N notes."""


def score_arrays(score: Score) -> dict[str, NDArray[Any]]:
    """A score as the arrays of `SCORE_SCHEMA`; remarks only where there are some."""
    arrays = {
        name: np.asarray(getattr(score, name.removeprefix("score_"))) for name in SCORE_SCHEMA
    }
    if not score.remarks:
        del arrays["score_remarks"]
    return arrays


def score_of(arrays: Mapping[str, NDArray[Any]]) -> Score:
    """The score of these arrays.

    Raises:
        ScoreError: they do not fit together.
    """
    return Score(
        key=arrays["score_key"],
        onset=arrays["score_onset"],
        offset=arrays["score_offset"],
        velocity=arrays["score_velocity"],
        pedal=arrays["score_pedal"],
        title=str(arrays["score_title"]),
        remarks=tuple(map(str, arrays.get("score_remarks", ()))),
    )


def plan_arrays(plan: FingertipPlan) -> dict[str, NDArray[Any]]:
    """A plan as the arrays of `PLAN_SCHEMA`."""
    return {name: getattr(plan, name.removeprefix("plan_")) for name in PLAN_SCHEMA}


def plan_of(arrays: Mapping[str, NDArray[Any]]) -> FingertipPlan:
    """The plan of these arrays.

    Raises:
        ValueError: they do not fit together.
    """
    return FingertipPlan(
        fingertips=arrays["plan_fingertips"],
        finger_key=arrays["plan_finger_key"],
        note_hand=arrays["plan_note_hand"],
        note_finger=arrays["plan_note_finger"],
    )
