"""FingertipPlan: what it accepts, and what can be asked of it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.keyboard import NO_KEY
from pianomime.plan import LEFT, RIGHT, FingertipPlan


def plan(frames: int = 4, **changed: NDArray[np.generic]) -> FingertipPlan:
    fields = {
        "fingertips": np.zeros((frames, 2, 6, 3)),
        "finger_key": np.full((frames, 2, 5), NO_KEY, np.int8),
        "note_hand": np.array([0, 1, -1], np.int8),
        "note_finger": np.array([2, 0, -1], np.int8),
    }
    return FingertipPlan(**{**fields, **changed})


def test_length_and_dropped_notes() -> None:
    assert len(plan(frames=7)) == 7
    assert plan().dropped == 1


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("fingertips", np.zeros((4, 2, 5, 3)), "fingertips must be"),
        ("fingertips", np.full((4, 2, 6, 3), np.nan), "not finite"),
        ("finger_key", np.zeros((3, 2, 5), np.int8), "finger_key must be"),
        ("finger_key", np.zeros((4, 10), np.int8), "finger_key must be"),
        ("note_hand", np.zeros(2, np.int8), "one entry per note"),
        ("joints", np.zeros((4, 2, 23)), "joints must be"),
        ("joints", np.zeros((3, 2, 27)), "joints must be"),
        ("joints", np.full((4, 2, 27), np.nan), "joints hold values that are not finite"),
    ],
)
def test_refuses_what_does_not_fit(name: str, value: NDArray[np.generic], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan(**{name: value})


def test_keys_of_both_hands() -> None:
    finger_key = np.full((3, 2, 5), NO_KEY, np.int8)
    finger_key[0, LEFT, 4] = 0
    finger_key[1, RIGHT, 0] = 40
    finger_key[1, LEFT, 0] = 39
    made = plan(3, finger_key=finger_key)
    wanted = np.zeros((3, 88), bool)
    wanted[[0, 1, 1], [0, 39, 40]] = True
    np.testing.assert_array_equal(made.keys(), wanted)
