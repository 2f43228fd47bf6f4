"""What is learned on: the same in memory as after it was saved and read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pianomime.learn.envs.reference import load_demonstration
from pianomime.plan.demonstration import Demonstration
from pianomime.track import DynamicTracker
from pianomime.world import World


def test_a_base_controller_follows_a_saved_plan_as_it_did_before(tmp_path: Path) -> None:
    made = load_demonstration("twinkle-twinkle", 0.0, 2.0)
    made.save(tmp_path / "plan.npz")
    read = Demonstration.load(tmp_path / "plan.npz")
    one, other = (DynamicTracker().start(each.plan) for each in (made, read))
    world = World()
    for frame in range(len(made.plan)):
        ctrl = one.control(frame, world)
        np.testing.assert_array_equal(other.control(frame, world), ctrl)
        world.step(ctrl)
