"""Looking ahead: what is known is simulated once, and again where it did not come true."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.plan import FingertipPlan
from pianomime.track.sampling.look_ahead import LookAhead
from pianomime.world import World
from pianomime.world.layout import LAYOUT

COUNT, PLAYED = 5, 2


class Waving:
    """A controller of two controls a frame that waves, and sees where the hands are."""

    replayable: ClassVar[bool] = True
    controls_per_frame: ClassVar[int] = 2
    plan: FingertipPlan | None = None

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        return 0.05 * frame + 0.3 * world.qpos_hands[: LAYOUT.ctrl_size]


def play(world: World, first: int, count: int) -> None:
    for control in range(2 * first, 2 * (first + count)):
        world.step(Waving().control(control, world), parts=2)


def test_it_is_what_is_played_then() -> None:
    world, look = World(), LookAhead(Waving())
    known = look.frames(0, COUNT, world)
    for number, step in enumerate(known):
        play(world, number, 1)
        np.testing.assert_array_equal(step.hands, world.qpos_hands)
        np.testing.assert_array_equal(step.state, world.state())
        np.testing.assert_array_equal(step.frame.pressed, world.pressed)
        assert step.ctrl.shape == (2, LAYOUT.ctrl_size)


@pytest.mark.parametrize(("pushed", "again"), [(False, PLAYED), (True, COUNT)])
def test_what_came_true_is_not_simulated_again(pushed: bool, again: int) -> None:
    world, look = World(), LookAhead(Waving())
    look.frames(0, COUNT, world)
    look.played(PLAYED)
    play(world, 0, PLAYED)
    if pushed:
        world.reset(world.qpos + 1e-6)
    known = look.frames(PLAYED, COUNT, world)
    assert look.steps == COUNT + again
    fresh = LookAhead(Waving()).frames(PLAYED, COUNT, world)
    for one, other in zip(known, fresh, strict=True):
        np.testing.assert_array_equal(one.state, other.state)


def test_what_is_forgotten_is_simulated_again() -> None:
    world, look = World(), LookAhead(Waving())
    look.frames(0, COUNT, world)
    look.forget()
    look.frames(0, COUNT, world)
    assert look.steps == 2 * COUNT
