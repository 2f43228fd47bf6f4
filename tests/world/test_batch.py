"""Many worlds at once: each of them is the one World, bit for bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.world import PhysicsWarning, World, WorldBatch

WORLDS = 3
STEPS = 80


@pytest.fixture
def controls(song_controls: NDArray[np.float64]) -> NDArray[np.float64]:
    """(80, 3, 46): each world begins elsewhere in the song."""
    return np.stack([song_controls[first : first + STEPS] for first in (0, 30, 60)], axis=1)


def assert_same(batch: WorldBatch, worlds: list[World]) -> None:
    """Everything that the physics goes on from is the same to the last bit."""
    np.testing.assert_array_equal(batch.state(), [world.state() for world in worlds])
    for name in ("qpos", "qpos_hands", "qvel_hands", "key_state", "pressed", "blow_ups", "pedal"):
        np.testing.assert_array_equal(
            getattr(batch, name), [getattr(world, name) for world in worlds]
        )


@pytest.mark.parametrize("threads", [1, 2])
def test_each_is_one_world(threads: int, controls: NDArray[np.float64]) -> None:
    batch, worlds = WorldBatch(WORLDS, threads), [World() for _ in range(WORLDS)]
    assert_same(batch, worlds)
    contacts = 0
    for ctrl in controls:
        batch.step(ctrl, pedal=[True, False, True])
        for world, mine, pedal in zip(worlds, ctrl, (True, False, True), strict=True):
            world.step(mine, pedal)
            contacts += world.data.ncon
        assert_same(batch, worlds)
    assert contacts > 100


def test_all_cores_by_default(controls: NDArray[np.float64]) -> None:
    everywhere, alone = WorldBatch(WORLDS), WorldBatch(WORLDS, threads=1)
    for ctrl in controls[:20]:
        everywhere.step(ctrl)
        alone.step(ctrl)
    np.testing.assert_array_equal(everywhere.state(), alone.state())


def test_shapes() -> None:
    batch = WorldBatch(2)
    assert len(batch) == 2
    assert batch.qpos.shape == (2, 142)
    assert batch.qpos_hands.shape == batch.qvel_hands.shape == (2, 54)
    assert batch.key_state.shape == batch.pressed.shape == (2, KEYS)
    assert batch.blow_ups.shape == batch.pedal.shape == (2,)


def test_what_is_read_is_the_callers_own(controls: NDArray[np.float64]) -> None:
    batch = WorldBatch(WORLDS)
    qpos, state = batch.qpos, batch.state()
    batch.step(controls[0])
    assert not qpos.any()
    assert not np.array_equal(state, batch.state())


def test_some_can_be_reset(controls: NDArray[np.float64]) -> None:
    batch, worlds = WorldBatch(WORLDS), [World() for _ in range(WORLDS)]
    hands = np.linspace(-0.04, 0.0, 54)
    for row, ctrl in enumerate(controls[:30]):
        if row == 15:
            batch.reset(hands, ids=[0, 2])
            worlds[0].reset(hands)
            worlds[2].reset(hands)
        batch.step(ctrl)
        for world, mine in zip(worlds, ctrl, strict=True):
            world.step(mine)
        assert_same(batch, worlds)


def test_each_can_be_reset_to_a_pose_of_its_own() -> None:
    batch = WorldBatch(WORLDS)
    poses = np.linspace(-0.04, 0.0, WORLDS * 142).reshape(WORLDS, 142)
    batch.reset(poses)
    np.testing.assert_array_equal(batch.qpos, poses)
    batch.reset()
    assert not batch.qpos.any()


def test_worlds_go_to_a_moment_of_a_song(controls: NDArray[np.float64]) -> None:
    """Several ways to go on from the same state, as World goes on from it."""
    leader = World()
    for ctrl in controls[:40, 0]:
        leader.step(ctrl)
    batch, worlds = WorldBatch(WORLDS), [World() for _ in range(WORLDS)]
    for ctrl in controls[:7]:
        batch.step(ctrl)
    batch.set_state(leader.state())
    for world in worlds:
        world.set_state(leader.state())
    for ctrl in controls[40:]:
        batch.step(ctrl)
        for world, mine in zip(worlds, ctrl, strict=True):
            world.step(mine)
        assert_same(batch, worlds)


def test_a_state_leads_back(controls: NDArray[np.float64]) -> None:
    batch = WorldBatch(WORLDS)
    for ctrl in controls[:40]:
        batch.step(ctrl)
    states = batch.state()
    ends = []
    for _ in range(2):
        batch.set_state(states)
        for ctrl in controls[40:60]:
            batch.step(ctrl)
        ends.append(batch.state())
    np.testing.assert_array_equal(*ends)


def test_broken_physics_in_one_world_is_its_own(controls: NDArray[np.float64]) -> None:
    batch, worlds = WorldBatch(WORLDS), [World() for _ in range(WORLDS)]
    for row, ctrl in enumerate(controls):
        if row == 40:
            states = batch.state()
            states[1, 1 + 142 + KEYS] = 1e12
            batch.set_state(states)
            for world, state in zip(worlds, states, strict=True):
                world.set_state(state)
            with pytest.warns(PhysicsWarning, match=r"\(worlds 1\)") as warned:
                batch.step(ctrl)
            assert len(warned) == 1
            with pytest.warns(PhysicsWarning):
                worlds[1].step(ctrl[1])
            worlds[0].step(ctrl[0])
            worlds[2].step(ctrl[2])
        else:
            batch.step(ctrl)
            for world, mine in zip(worlds, ctrl, strict=True):
                world.step(mine)
        assert_same(batch, worlds)
    np.testing.assert_array_equal(batch.blow_ups, [0, 1, 0])


@pytest.mark.parametrize("restored", [False, True])
def test_worlds_that_are_not_reset_keep_what_they_heard(
    restored: bool, controls: NDArray[np.float64]
) -> None:
    batch = WorldBatch(WORLDS, 1)
    for ctrl in controls:
        batch.step(ctrl)
        heard = batch.key_events
        if len(set(heard.world)) == WORLDS:
            break
    assert len(set(heard.world)) == WORLDS
    if restored:
        batch.set_state(batch.state()[[0, 2]], ids=[0, 2])
    else:
        batch.reset(ids=[0, 2])
    for before, after in zip(heard, batch.key_events, strict=True):
        np.testing.assert_array_equal(after, before[heard.world == 1])
    batch.reset()
    assert len(batch.key_events.key) == 0


@pytest.mark.parametrize(
    "ids",
    [[True, False, True], [2, 0], [1, 1], [-1], [3], [0.0, 1.0], [[0, 1]], 1],
    ids=["mask", "falling", "twice", "negative", "beyond", "fractions", "table", "number"],
)
def test_worlds_are_named_by_rising_indices(ids: Any, controls: NDArray[np.float64]) -> None:
    batch = WorldBatch(WORLDS, 1)
    for ctrl in controls[:40]:
        batch.step(ctrl, pedal=True)
    before, heard = batch.state(), batch.key_events
    sounding, rows = batch.sounding.copy(), np.size(ids)
    for change in (
        lambda: batch.reset(ids=ids),
        lambda: batch.set_state(before[:rows], ids=ids),
        lambda: batch.step(np.zeros((rows, 46)), ids=ids),
    ):
        with pytest.raises(ValueError, match="ids must"):
            change()
    np.testing.assert_array_equal(batch.state(), before)
    np.testing.assert_array_equal(batch.sounding, sounding)
    assert batch.pedal.all()
    assert batch.key_events is heard


def test_none_can_be_named(controls: NDArray[np.float64]) -> None:
    batch = WorldBatch(WORLDS, 1)
    batch.step(controls[0])
    before = batch.state()
    batch.reset(ids=[])
    np.testing.assert_array_equal(batch.state(), before)


def test_wrong_input() -> None:
    batch = WorldBatch(2)
    with pytest.raises(ValueError, match="ctrl must be"):
        batch.step(np.zeros(46))
    with pytest.raises(ValueError, match="not finite"):
        batch.step(np.full((2, 46), np.nan))
    with pytest.raises(ValueError, match="qpos must"):
        batch.reset(np.zeros((2, 88)))
    with pytest.raises(ValueError, match="shape"):
        batch.set_state(np.zeros((3, 5)))
    with pytest.raises(ValueError, match="cannot make 0 worlds"):
        WorldBatch(0)


def test_some_can_be_stepped(controls: NDArray[np.float64]) -> None:
    """They are worlds as before; the others rest as they are, and nothing is heard of them."""
    batch, worlds = WorldBatch(WORLDS, 1), [World() for _ in range(WORLDS)]
    events = 0
    for number, ctrl in enumerate(controls):
        ids = np.flatnonzero([True, number % 3 != 1, number % 7 != 2])
        batch.step(ctrl[ids], pedal=np.array([True, False, True])[ids], ids=ids)
        heard = batch.key_events
        assert set(heard.world) <= set(ids)
        for index in ids:
            worlds[index].step(ctrl[index], pedal=index != 1)
            mine = heard.world == index
            np.testing.assert_array_equal(heard.time[mine], worlds[index].key_events.time)
            np.testing.assert_array_equal(heard.key[mine], worlds[index].key_events.key)
            events += mine.sum()
        assert_same(batch, worlds)
        np.testing.assert_array_equal(batch.sounding, [world.sounding for world in worlds])
    assert events > 20


def test_broken_physics_in_some_that_are_stepped() -> None:
    batch = WorldBatch(WORLDS, 1, quiet=True)
    state = batch.state()
    qvel = 1 + 142 + 90  # time and positions stand before the velocities in a state
    state[:, qvel] = 1e12
    batch.set_state(state)
    batch.step(np.zeros((2, 46)), ids=[0, 2])
    np.testing.assert_array_equal(batch.blow_ups, [1, 0, 1])
    np.testing.assert_array_equal(batch.state()[1], state[1])
    assert not batch.qpos_hands[[0, 2]].any()
