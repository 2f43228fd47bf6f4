"""Fingerings and hand paths are those that are stored: the F1 depends on every cost and weight.

`python benchmarks/digest.py --write` makes the stored ones anew.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pianomime import Score, excerpt, songs
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.plan.fingering import find_fingering
from pianomime.plan.hand_path import make_feasible
from pianomime.plan.joint_path import PathProblem, smooth_path
from pianomime.world.hand import Hand

STORED = Path(__file__).with_name("fingerings.npz")
NAMES = sorted({name.partition(":")[0] for name in np.load(STORED).files if ":" in name})


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


def test_the_joint_path_is_the_stored_one() -> None:
    """With the weights that the dynamic tracker leaves as they are."""
    stored = np.load(STORED.parents[1] / "track" / "controls.npz")
    points = stored["fingertips"][:, 1] + [0.0, 0.0, 0.03]
    clearance = np.full((len(points), 5), 0.01)
    weights = np.full(points.shape, 250.0)
    path = smooth_path(PathProblem(Hand("rh"), np.zeros(27), points, weights, clearance))
    np.testing.assert_allclose(path, stored["path"], atol=1e-6)


def test_a_humans_plan_becomes_the_stored_one() -> None:
    stored = np.load(STORED.parents[1] / "track" / "controls.npz")
    fingertips = stored["fingertips"] + [0.01, -0.004, 0.02]
    nobody = np.empty(0, np.int8)
    human = FingertipPlan(fingertips, stored["finger_key"], nobody, nobody)
    np.testing.assert_allclose(make_feasible(human).fingertips, stored["feasible"], atol=1e-6)
