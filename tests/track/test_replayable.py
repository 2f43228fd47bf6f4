"""Which controllers may be asked ahead on copies of the world."""

from __future__ import annotations

import numpy as np
import pytest

from pianomime.keyboard import NO_KEY
from pianomime.plan import FingertipPlan
from pianomime.track import (
    DynamicTracker,
    IkTracker,
    PredictiveSamplingConfig,
    PredictiveSamplingTracker,
    ReplayTracker,
    Tracker,
)
from pianomime.world import World
from pianomime.world.layout import LAYOUT

FRAMES = 6


@pytest.mark.parametrize(
    "tracker",
    [DynamicTracker(), IkTracker(), ReplayTracker(np.zeros((FRAMES, LAYOUT.ctrl_size)))],
    ids=lambda tracker: type(tracker).__name__,
)
def test_controllers_without_a_memory_can_be_improved(tracker: Tracker) -> None:
    """Asked for any frame, in any order, they give the same; sampling does not."""
    rest = World().fingertips
    nobody = np.empty(0, np.int8)
    plan = FingertipPlan(
        np.tile(rest, (FRAMES, 1, 1, 1)), np.full((FRAMES, 2, 5), NO_KEY, np.int8), nobody, nobody
    )
    controller, world = tracker.start(plan), World()
    assert controller.replayable
    forward = [controller.control(frame, world) for frame in range(FRAMES)]
    backward = [controller.control(frame, world) for frame in reversed(range(FRAMES))]
    np.testing.assert_array_equal(forward, backward[::-1])
    assert controller.plan is plan
    improved = PredictiveSamplingTracker(tracker, PredictiveSamplingConfig(variations=1))
    assert not improved.start(plan).replayable
