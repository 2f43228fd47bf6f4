"""Keys sense when they sound, how fast they went down, and when they fall silent."""

from __future__ import annotations

import numpy as np
import pytest

from pianomime import World, WorldBatch
from pianomime.keyboard import KEYS
from pianomime.world.key_sensor import sense, silent_at, sounds_at
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import PHYSICS_DT, SUBSTEPS, key_levers


def angles(*path: float, key: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """(n + 1, 1, 88) angles and speeds of one key, given as shares of where it sounds."""
    angle = np.zeros((len(path), 1, KEYS))
    angle[:, 0, key] = np.array(path) * sounds_at()[key]
    velocity = np.zeros_like(angle)
    velocity[1:] = np.diff(angle, axis=0) / PHYSICS_DT
    return angle, velocity


def test_a_note_is_timed_between_physics_steps() -> None:
    sounding = np.zeros((1, KEYS), bool)
    events = sense(*angles(0.0, 0.5, 0.9, 1.1), sounding)
    assert events.key.tolist() == [40]
    assert events.on.tolist() == [True]
    assert events.time[0] == pytest.approx(2.5 * PHYSICS_DT)
    assert events.speed[0] == pytest.approx(0.4 * sounds_at()[40] / PHYSICS_DT * key_levers()[40])
    assert sounding[0].nonzero()[0].tolist() == [40]


def test_a_key_that_trembles_at_the_bottom_sounds_once() -> None:
    sounding = np.zeros((1, KEYS), bool)
    events = sense(*angles(0.0, 1.1, 0.9, 1.1, 0.8, 1.05), sounding)
    assert events.on.tolist() == [True]


def test_a_key_sounds_again_after_it_came_back_half_way() -> None:
    sounding = np.zeros((1, KEYS), bool)
    back = 0.9 * silent_at()[40] / sounds_at()[40]
    events = sense(*angles(0.0, 1.1, back, 1.1), sounding)
    assert events.on.tolist() == [True, False, True]
    assert np.all(np.diff(events.time) > 0)


def press(key: int, ahead: float) -> np.ndarray:
    """(142,) positions with one key at a share of its way down."""
    qpos = np.zeros(LAYOUT.qpos_size)
    qpos[key] = ahead * sounds_at()[key]
    return qpos


def test_a_world_that_is_set_with_a_key_down_hears_it_silently_and_then_its_end() -> None:
    world = World()
    world.reset(press(40, 1.05))
    assert world.sounding[40]
    assert len(world.key_events.key) == 0
    world.step(np.zeros(LAYOUT.ctrl_size))
    # Nothing holds it: its spring brings it back.
    assert world.key_events.key.tolist() == [40]
    assert not world.key_events.on[0]
    assert 0 < world.key_events.time[0] < 0.05
    assert not world.sounding.any()


@pytest.mark.parametrize("parts", [1, 2, 5, 10])
def test_equal_parts_of_a_frame_are_one_frame(parts: int) -> None:
    ctrl = np.random.default_rng(0).uniform(-0.2, 0.4, LAYOUT.ctrl_size)
    whole, divided = World(), World()
    whole.step(ctrl)
    divided.step(np.tile(ctrl, (parts, 1)))
    assert np.array_equal(whole.state(), divided.state())


def test_a_frame_cannot_have_three_controls() -> None:
    with pytest.raises(ValueError, match="cannot have 3 controls"):
        World().step(np.zeros((3, LAYOUT.ctrl_size)))
    with pytest.raises(ValueError, match="cannot have 3 controls"):
        WorldBatch(2).step(np.zeros((2, 3, LAYOUT.ctrl_size)))


def test_a_batch_senses_what_worlds_do() -> None:
    rng = np.random.default_rng(1)
    worlds = [World(quiet=True) for _ in range(3)]
    batch = WorldBatch(3, quiet=True)
    heard = 0
    for _ in range(40):
        ctrl = rng.uniform(-0.5, 1.5, (3, SUBSTEPS // 2, LAYOUT.ctrl_size))
        batch.step(ctrl)
        events = batch.key_events
        for index, world in enumerate(worlds):
            world.step(ctrl[index])
            mine = events.world == index
            for name in ("key", "on", "time", "speed"):
                ours = getattr(world.key_events, name)
                assert np.array_equal(ours, getattr(events, name)[mine]), name
            assert np.array_equal(world.sounding, batch.sounding[index])
            heard += int(world.key_events.on.sum())
    assert heard > 10


def test_copies_sense_alike() -> None:
    world = World()
    world.reset(press(40, 1.05))
    copy = world.copy()
    for _ in range(3):
        world.step(np.zeros(LAYOUT.ctrl_size))
        copy.step(np.zeros(LAYOUT.ctrl_size))
        assert np.array_equal(world.sounding, copy.sounding)
        assert np.array_equal(world.key_events.time, copy.key_events.time)
