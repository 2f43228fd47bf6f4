"""One World: what goes in, what comes out, and what happens when the physics breaks."""

from __future__ import annotations

import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, KEYS
from pianomime.world import PhysicsWarning, World
from pianomime.world.layout import LAYOUT
from pianomime.world.model import build_spec
from pianomime.world.parameters import key_travel

TX = 20  # Along the keyboard, among a hand's actuators.


def everything(world: World) -> NDArray[np.float64]:
    return np.concatenate([world.data.qpos, world.data.qvel])


def run(world: World, controls: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, 284) positions and velocities after each step."""
    states = np.empty((len(controls), 284))
    for row, ctrl in enumerate(controls):
        world.step(ctrl)
        states[row] = everything(world)
    return states


def break_physics(world: World) -> None:
    state = world.state()
    state[1 + 142 + KEYS] = 1e12  # The first velocity of the hands, after time and positions.
    world.set_state(state)


def test_starts_at_rest() -> None:
    world = World()
    assert not world.qpos.any()
    assert not world.pressed.any()
    assert not world.key_state.any()
    assert world.blow_ups == 0
    assert not world.pedal


def test_shapes() -> None:
    world = World()
    assert world.qpos.shape == (142,)
    assert world.qpos_hands.shape == world.qvel_hands.shape == (54,)
    assert world.key_state.shape == world.pressed.shape == (KEYS,)
    assert world.fingertips.shape == (2, 6, 3)


def test_what_is_read_is_the_callers_own(song_controls: NDArray[np.float64]) -> None:
    world = World()
    names = ("qpos", "qpos_hands", "qvel_hands", "key_state", "pressed", "fingertips")
    read = {name: getattr(world, name) for name in names}
    kept = {name: array.copy() for name, array in read.items()}
    run(world, song_controls[:5])
    for name in names:
        np.testing.assert_array_equal(read[name], kept[name])
    assert world.qpos.any()


def test_reset_puts_hands_anywhere() -> None:
    world = World()
    hands = np.linspace(-0.04, 0.0, 54)
    world.reset(hands)
    np.testing.assert_array_equal(world.qpos_hands, hands)
    assert not world.qpos[:KEYS].any()


def test_reset_forgets(song_controls: NDArray[np.float64]) -> None:
    world = World()
    first = run(world, song_controls[:20])
    world.reset()
    np.testing.assert_array_equal(run(world, song_controls[:20]), first)


@pytest.mark.parametrize("wrong", [np.zeros(88), np.zeros((2, 27)), 0.0])
def test_reset_wants_all_joints(wrong: NDArray[np.float64]) -> None:
    with pytest.raises(ValueError, match="qpos must"):
        World().reset(wrong)


def test_step_wants_46_controls() -> None:
    with pytest.raises(ValueError, match=r"ctrl must be \(46,\), not \(47,\)"):
        World().step(np.zeros(47))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_step_wants_finite_controls(bad: float) -> None:
    ctrl = np.zeros(46)
    ctrl[3] = bad
    with pytest.raises(ValueError, match="not finite"):
        World().step(ctrl)
    with pytest.raises(ValueError, match="not finite"):
        World().reset(np.full(142, bad))


def test_step_is_a_twentieth_of_a_second() -> None:
    world = World()
    world.step(np.zeros(46))
    assert world.data.time == pytest.approx(0.05)


def test_controls_beyond_their_range_are_clamped() -> None:
    one, other = World(), World()
    high = one.model.actuator_ctrlrange[:, 1]
    np.testing.assert_array_equal(run(one, [high] * 10), run(other, [high + 5.0] * 10))


def test_pedal() -> None:
    world = World()
    world.step(np.zeros(46), pedal=True)
    assert world.pedal
    world.step(np.zeros(46))
    assert not world.pedal


@pytest.mark.parametrize(("short", "sounds"), [(0.0, True), (0.49, True), (0.51, False)])
def test_a_key_sounds_half_a_degree_from_its_stop(short: float, sounds: bool) -> None:
    world = World()
    qpos = world.qpos
    qpos[:KEYS] = key_travel() - np.radians(short)
    world.reset(qpos)
    assert (world.pressed == sounds).all()
    assert ((world.key_state > 0.8) & (world.key_state <= 1.0)).all()


def test_keys_come_up_by_themselves() -> None:
    world = World()
    qpos = world.qpos
    qpos[:KEYS] = key_travel()
    world.reset(qpos)
    for _ in range(10):
        world.step(np.zeros(46))
    assert (world.key_state < 0.05).all()


def test_hands_play(song_controls: NDArray[np.float64]) -> None:
    world = World()
    played = np.zeros(KEYS, bool)
    for ctrl in song_controls:
        world.step(ctrl)
        played |= world.pressed
    assert played.sum() >= 8
    assert world.blow_ups == 0


def test_the_same_controls_give_the_same_bits(song_controls: NDArray[np.float64]) -> None:
    one, other = World(), World()
    np.testing.assert_array_equal(run(one, song_controls), run(other, song_controls))


def test_hands_move_as_mirror_images() -> None:
    """Law: mirrored controls give mirrored motion, as long as no key is touched."""
    world, mirrored = World(), World()
    draw = np.random.default_rng(1)
    low, high = world.model.actuator_ctrlrange.T
    # About a pose high over the keys; a reach, then another.
    for _ in range(6):
        reach = draw.uniform(0.0, 0.3, 46) * (high - low)
        ctrl = np.clip(0.0, low, high) + np.where(low == 0.0, reach, reach - 0.15 * (high - low))
        ctrl[[TX + 1, TX + 2, TX + 24, TX + 25]] = 0.1, 0.0, 0.1, 0.0
        swapped = np.roll(ctrl, 23)
        swapped[[TX, TX + 23]] *= -1
        for _ in range(5):
            world.step(ctrl)
            mirrored.step(swapped)
            assert world.data.ncon == mirrored.data.ncon == 0
        there = mirrored.fingertips[::-1] * [1.0, -1.0, 1.0]
        np.testing.assert_allclose(world.fingertips, there, atol=1e-6)
    assert np.abs(world.qvel_hands).max() > 0.1


def test_sleeping_keys_change_nothing_that_matters(song_controls: NDArray[np.float64]) -> None:
    spec = build_spec()
    spec.option.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    wide_awake = World()
    wide_awake.model = spec.compile()
    wide_awake.data = mujoco.MjData(wide_awake.model)
    wide_awake.reset()
    world = World()
    same = []
    for ctrl in song_controls:
        world.step(ctrl)
        wide_awake.step(ctrl)
        same.append(np.array_equal(world.pressed, wide_awake.pressed))
        np.testing.assert_allclose(world.key_state, wide_awake.key_state, atol=0.5)
    assert np.mean(same) > 0.95
    assert (world.data.tree_asleep[:KEYS] >= 0).sum() > 60


def test_a_copy_goes_on_bit_for_bit(song_controls: NDArray[np.float64]) -> None:
    world = World()
    run(world, song_controls[:60])
    copy = world.copy()
    np.testing.assert_array_equal(run(copy, song_controls[60:]), run(world, song_controls[60:]))


def test_a_copy_is_another_world() -> None:
    world = World()
    world.step(np.zeros(46), pedal=True)
    copy = world.copy()
    assert copy.pedal
    before = everything(world)
    copy.step(np.full(46, 0.1))
    np.testing.assert_array_equal(everything(world), before)


def test_a_state_leads_every_world_the_same_way(song_controls: NDArray[np.float64]) -> None:
    world = World()
    run(world, song_controls[:60])
    state = world.state()
    fresh, used = World(), World()
    run(used, song_controls[80:90])
    fresh.set_state(state)
    used.set_state(state)
    np.testing.assert_array_equal(everything(fresh), everything(world))
    on = run(fresh, song_controls[60:])
    np.testing.assert_array_equal(run(used, song_controls[60:]), on)
    # Keys that slept are awake after it, which hardly shows.
    exactly = run(world, song_controls[60:])
    assert np.median(np.abs(on - exactly)[:, :142]) < 1e-4
    np.testing.assert_allclose(on[:5, :142], exactly[:5, :142], atol=2e-3)


def test_a_state_must_be_whole_and_finite() -> None:
    world = World()
    with pytest.raises(ValueError, match="state must be"):
        world.set_state(world.state()[1:])
    with pytest.raises(ValueError, match="not finite"):
        world.set_state(world.state() * np.nan)


def test_broken_physics_is_counted_and_told(song_controls: NDArray[np.float64]) -> None:
    world = World()
    run(world, song_controls[:40])
    break_physics(world)
    before = world.qpos
    with pytest.warns(PhysicsWarning, match="physics broke") as warned:
        world.step(song_controls[40])
    assert len(warned) == 1
    assert world.blow_ups == 1
    along = [LAYOUT.joints[1].start, LAYOUT.joints[0].start]
    np.testing.assert_array_equal(world.qpos[along], before[along])
    assert np.count_nonzero(world.qpos) == 2
    assert not world.data.qvel.any()


def test_after_broken_physics_the_song_goes_on(song_controls: NDArray[np.float64]) -> None:
    world = World()
    run(world, song_controls[:40])
    break_physics(world)
    with pytest.warns(PhysicsWarning):
        world.step(song_controls[40])
    played = np.zeros(KEYS, bool)
    with warnings.catch_warnings():
        warnings.simplefilter("error", PhysicsWarning)
        for ctrl in song_controls[41:]:
            world.step(ctrl)
            played |= world.pressed
    assert played.any()
    assert world.blow_ups == 1
    world.reset()
    assert world.blow_ups == 0


def test_no_log_beside_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo would write MUJOCO_LOG.TXT into the current folder."""
    monkeypatch.chdir(tmp_path)
    world = World()
    break_physics(world)
    with pytest.warns(PhysicsWarning):
        world.step(np.zeros(46))
    assert not list(tmp_path.iterdir())


def test_black_and_white_keys_both_sound() -> None:
    world = World()
    qpos = world.qpos
    qpos[:KEYS][BLACK] = key_travel()[BLACK]
    world.reset(qpos)
    np.testing.assert_array_equal(world.pressed, BLACK)


def test_every_physics_step_can_be_watched(song_controls: NDArray[np.float64]) -> None:
    watched, plain = World(), World()
    times: list[float] = []
    seen: list[NDArray[np.float64]] = []

    def watch() -> None:
        times.append(float(watched.data.time))
        seen.append(everything(watched))

    for ctrl in song_controls[:20]:
        watched.step(ctrl, watch=watch)
        plain.step(ctrl)
        np.testing.assert_array_equal(seen[-1], everything(plain))
    np.testing.assert_allclose(times, 0.005 * np.arange(1, 201))
    assert len({row.tobytes() for row in seen}) == len(seen)
