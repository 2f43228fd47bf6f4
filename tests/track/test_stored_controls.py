"""Controls are those that are stored, in stored states: every gain and weight of the trackers.

`python benchmarks/digest.py --write` makes the stored ones anew.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pianomime.plan import FingertipPlan
from pianomime.track import DynamicTracker, IkTracker

STORED = Path(__file__).with_name("controls.npz")


@pytest.mark.parametrize(
    ("name", "make", "tolerance"), [("dynamic", DynamicTracker, 1e-6), ("ik", IkTracker, 1e-4)]
)
def test_controls_are_the_stored_ones(
    name: str, make: type[DynamicTracker] | type[IkTracker], tolerance: float
) -> None:
    stored = np.load(STORED)
    nobody = np.empty(0, np.int8)
    plan = FingertipPlan(stored["fingertips"], stored["finger_key"], nobody, nobody)
    frames = np.arange(len(plan))
    ctrl, points = make().start(plan).controls(frames, stored["qpos"])
    assert points.shape == (len(plan), 2, 6, 3)
    np.testing.assert_allclose(ctrl, stored[name], atol=tolerance)
