"""The one loop in which a controller meets a World."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np

import pianomime
from pianomime import World, rollout
from pianomime.world.layout import LAYOUT

ROOM = Path(pianomime.__file__).parent


class Counting:
    """Holds still, and writes down what it saw."""

    replayable = False
    plan = None

    def __init__(self) -> None:
        self.seen: list[np.ndarray] = []

    def control(self, frame: int, world: World) -> np.ndarray:
        assert frame == len(self.seen)
        self.seen.append(world.state())
        return np.full(LAYOUT.ctrl_size, 0.01 * frame)


class WithPedal(Counting):
    def pedal(self, frame: int) -> bool:
        return frame % 2 == 1


def test_frames_come_in_order_from_the_state_before_to_the_state_after() -> None:
    controller, world = Counting(), World()
    after = [world.state()]
    pedal = np.array([True, False, True, True])
    for step in rollout(controller, world, pedal):
        assert step.frame == len(after) - 1
        np.testing.assert_array_equal(step.ctrl, np.full(LAYOUT.ctrl_size, 0.01 * step.frame))
        assert step.pedal == world.pedal == pedal[step.frame]
        after.append(world.state())
    for before, seen in zip(after, controller.seen, strict=False):
        np.testing.assert_array_equal(seen, before)
    assert len(controller.seen) == len(pedal)


def test_a_controller_that_works_the_pedal_does() -> None:
    world = World()
    steps = list(rollout(WithPedal(), world, np.ones(4, bool)))
    assert [step.pedal for step in steps] == [False, True, False, True]


def test_they_are_the_only_such_loops() -> None:
    """Nobody else asks for controls and steps a World by them, but to look ahead or prepare."""
    both = []
    for file in sorted(ROOM.rglob("*.py")):
        for function in ast.walk(ast.parse(file.read_text("utf-8"))):
            if not isinstance(function, ast.FunctionDef):
                continue
            called = {
                node.func.attr
                for node in ast.walk(function)
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
            }
            if {"control", "step"} <= called:
                both.append((file.relative_to(ROOM).as_posix(), function.name))
    assert both == [
        ("players/rollout.py", "rollout"),
        ("players/rollout.py", "rollout_together"),
        ("track/calibration.py", "_strikes"),
        ("track/nominal_tracking.py", "settle"),
        ("track/rehearsal.py", "_listen"),
        ("track/sampling/look_ahead.py", "_step"),
    ]
