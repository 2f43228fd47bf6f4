"""Fingerings and hand paths are those that are stored: the F1 depends on every cost and weight.

`python benchmarks/digest.py --write` makes the stored ones anew.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pianomime import Score, excerpt, songs
from pianomime.plan import ZeroShotPlanner
from pianomime.plan.fingering import find_fingering

STORED = Path(__file__).with_name("fingerings.npz")
NAMES = sorted({name.partition(":")[0] for name in np.load(STORED).files})


@pytest.mark.parametrize("name", NAMES)
def test_the_fingering_is_the_stored_one(name: str) -> None:
    stored = np.load(STORED)
    key, onset, offset = stored[f"{name}: notes"]
    score = Score(key.astype(int), onset, offset, np.full(len(key), 64))
    fingering = find_fingering(score)
    hand, finger, start, stop = stored[f"{name}: fingering"]
    np.testing.assert_array_equal(fingering.hand, hand)
    np.testing.assert_array_equal(fingering.finger, finger)
    np.testing.assert_array_equal(fingering.start, start)
    np.testing.assert_array_equal(fingering.stop, stop)


def test_the_hard_ones_have_notes_left_out_cut_short_and_late() -> None:
    stored = np.load(STORED)
    kinds = np.zeros(3, int)
    for name in NAMES:
        key, onset, offset = stored[f"{name}: notes"]
        frames = Score(key.astype(int), onset, offset, np.full(len(key), 64)).note_frames()
        hand, _, start, stop = stored[f"{name}: fingering"]
        played = hand >= 0
        kinds += (
            (~played).sum(),
            (played & (stop < frames[:, 1])).sum(),
            (played & (start > frames[:, 0])).sum(),
        )
    assert (kinds > 5).all()


def test_the_hand_paths_are_the_stored_ones() -> None:
    stored = np.load(STORED.parents[1] / "track" / "controls.npz")
    score = excerpt(Score.from_midi(songs.path("beethoven-fur-elise")), seconds=4.0)
    plan = ZeroShotPlanner().plan(score)
    np.testing.assert_array_equal(plan.finger_key, stored["finger_key"])
    np.testing.assert_allclose(plan.fingertips, stored["fingertips"], atol=1e-6)
