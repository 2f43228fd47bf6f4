"""Worlds stepped by MuJoCo Warp, on one core: the rules of WorldBatch, and nearly its physics."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.device_names import DeviceName
from pianomime.errors import InputError
from pianomime.keyboard import KEYS
from pianomime.world import PhysicsWarning, WorldBatch
from pianomime.world.batch_base import WorldBatchBase
from pianomime.world.device_batch import device_batch
from pianomime.world.layout import LAYOUT
from pianomime.world.model import world_model
from pianomime.world.warp_physics import warp_physics

WORLDS = 3
STEPS = 12
NEAR = 1e-3
"""[rad, m] Largest difference to MuJoCo's same physics within 12 control steps: ten times what was
measured with recorded controls of experts, which press keys meanwhile."""
SAME_TIME = 1e-4
"""[s] Largest difference between the times of an event."""


@pytest.fixture(scope="module")
def make() -> Callable[[int], WorldBatchBase]:
    """Makes batches on the device of these tests."""
    pytest.importorskip("mujoco_warp", reason="the extra gpu is not installed")
    return lambda worlds: device_batch(worlds, "warp-cpu")


@pytest.fixture(scope="module")
def worlds(make: Callable[[int], WorldBatchBase]) -> WorldBatchBase:
    return make(WORLDS)


@pytest.fixture
def batch(worlds: WorldBatchBase) -> WorldBatchBase:
    """The same batch for each test, at rest."""
    worlds.quiet = False
    worlds.reset()
    return worlds


@pytest.fixture
def controls(song_controls: NDArray[np.float64]) -> NDArray[np.float64]:
    """(80, 3, 46): each world plays the song with hands that reach a little less far."""
    return song_controls[:80, None] * np.array([1.0, 0.99, 0.98])[:, None]


def same_physics() -> WorldBatch:
    """MuJoCo, with the options that Warp simulates."""
    return WorldBatch(WORLDS, 1, model=warp_physics(world_model()))


def test_it_plays_as_mujoco_does(batch: WorldBatchBase, controls: NDArray[np.float64]) -> None:
    reference = same_physics()
    moved, pressed = 0.0, 0
    for ctrl in controls[:STEPS]:
        batch.step(ctrl, pedal=[True, False, True])
        reference.step(ctrl, pedal=[True, False, True])
        moved = max(moved, np.abs(reference.qpos_hands).max())
        pressed += int(reference.pressed.sum())
        np.testing.assert_allclose(batch.qpos, reference.qpos, atol=NEAR)
        np.testing.assert_array_equal(batch.pedal, reference.pedal)
    assert moved > 100 * NEAR
    assert pressed > 10
    assert len(batch) == WORLDS
    for name in ("qpos", "qpos_hands", "qvel_hands", "key_state", "pressed", "sounding"):
        mine, theirs = getattr(batch, name), getattr(reference, name)
        assert (mine.shape, mine.dtype) == (theirs.shape, theirs.dtype)
    assert batch.state().shape == reference.state().shape


def test_until_something_touches_it_plays_as_the_world_does(batch: WorldBatchBase) -> None:
    """Colliders differ, and where nothing touches they have no say."""
    reference = WorldBatch(WORLDS, 1)
    # Forearms slide along the keyboard, above the keys.
    ctrl = np.zeros((WORLDS, LAYOUT.ctrl_size))
    for hand in LAYOUT.actuators:
        ctrl[:, hand][:, LAYOUT.slide_actuators.start] = [-0.1, 0.05, 0.1]
    for _ in range(STEPS):
        batch.step(ctrl)
        reference.step(ctrl)
        np.testing.assert_allclose(batch.qpos_hands, reference.qpos_hands, atol=1e-5)
    assert np.abs(reference.qpos_hands).max() > 0.05


def test_keys_sense_the_same(batch: WorldBatchBase, controls: NDArray[np.float64]) -> None:
    """In each step from the same state: the same events of the same keys, in the same order."""
    reference, heard = same_physics(), 0
    for ctrl in controls[: 2 * STEPS]:
        batch.set_state(reference.state())
        batch.sounding[:] = reference.sounding
        batch.step(ctrl)
        reference.step(ctrl)
        mine, theirs = batch.key_events, reference.key_events
        for name in ("world", "key", "on"):
            np.testing.assert_array_equal(getattr(mine, name), getattr(theirs, name))
        np.testing.assert_allclose(mine.time, theirs.time, atol=SAME_TIME)
        np.testing.assert_allclose(mine.speed, theirs.speed, rtol=0.01, atol=1e-3)
        np.testing.assert_array_equal(batch.sounding, reference.sounding)
        heard += len(mine.key)
    assert heard > 10


def test_the_same_again(batch: WorldBatchBase, controls: NDArray[np.float64]) -> None:
    ends = []
    for _ in range(2):
        batch.reset()
        for ctrl in controls[:STEPS]:
            batch.step(ctrl)
        ends.append(batch.state())
    np.testing.assert_array_equal(*ends)


def test_a_state_leads_back(batch: WorldBatchBase, controls: NDArray[np.float64]) -> None:
    for ctrl in controls[:STEPS]:
        batch.step(ctrl)
    state, ends = batch.state(), []
    for _ in range(2):
        batch.set_state(state)
        np.testing.assert_array_equal(batch.state(), state)
        for ctrl in controls[STEPS : 2 * STEPS]:
            batch.step(ctrl)
        ends.append(batch.state())
    np.testing.assert_array_equal(*ends)
    assert (ends[0] != state).any()


def test_reset_and_step_of_some_leave_the_others(
    batch: WorldBatchBase, controls: NDArray[np.float64]
) -> None:
    for ctrl in controls[:STEPS]:
        batch.step(ctrl, pedal=True)
    before = batch.state()
    batch.reset(ids=[1])
    np.testing.assert_array_equal(batch.state()[[0, 2]], before[[0, 2]])
    assert not batch.qpos[1].any()
    np.testing.assert_array_equal(batch.pedal, [True, False, True])
    before = batch.state()
    batch.step(controls[STEPS, [0, 2]], ids=[0, 2])
    np.testing.assert_array_equal(batch.state()[1], before[1])
    alone = batch.state()
    batch.set_state(before)
    batch.step(controls[STEPS])
    np.testing.assert_array_equal(batch.state()[[0, 2]], alone[[0, 2]])
    assert (batch.state()[1] != before[1]).any()


def test_several_controls_in_a_frame(batch: WorldBatchBase, controls: NDArray[np.float64]) -> None:
    once, thrice = controls[0], np.repeat(controls[0][:, None], 5, axis=1)
    batch.step(once)
    state = batch.state()
    batch.reset()
    batch.step(thrice)
    np.testing.assert_array_equal(batch.state(), state)


def test_poses_of_their_own(batch: WorldBatchBase) -> None:
    poses = np.linspace(-0.04, 0.0, WORLDS * 142).reshape(WORLDS, 142)
    batch.reset(poses)
    np.testing.assert_allclose(batch.qpos, poses, atol=1e-8)


@pytest.mark.parametrize("wrong", [1e12, 1e30])
def test_broken_physics_in_one_world_is_its_own(
    wrong: float, batch: WorldBatchBase, controls: NDArray[np.float64]
) -> None:
    reference = WorldBatch(WORLDS, 1, quiet=True)
    for ctrl in controls[:STEPS]:
        batch.step(ctrl)
    sound = batch.state()
    batch.step(controls[STEPS])
    expected = batch.state()
    state = sound.copy()
    state[1, 1 + 142 + KEYS] = wrong  # time and positions stand before the velocities in a state
    batch.set_state(state)
    batch.sounding[1, 5] = True
    sounded = np.flatnonzero(batch.sounding[1])
    reference.set_state(state)
    with pytest.warns(PhysicsWarning, match=r"\(worlds 1\)"):
        batch.step(controls[STEPS])
    reference.step(controls[STEPS])
    np.testing.assert_array_equal(batch.state()[[0, 2]], expected[[0, 2]])
    np.testing.assert_array_equal(batch.blow_ups, [0, 1, 0])
    np.testing.assert_allclose(batch.qpos[1], reference.qpos[1], atol=1e-7)
    assert not batch.sounding[1].any()
    mine = batch.key_events.world == 1
    np.testing.assert_array_equal(batch.key_events.key[mine], sounded)
    assert not batch.key_events.on[mine].any()


def test_a_world_without_room_for_its_contacts_is_broken(
    make: Callable[[int], WorldBatchBase],
    controls: NDArray[np.float64],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("pianomime.world.warp_batch._CONTACTS", 1)
    crowded = make(WORLDS)
    crowded.quiet = True
    for ctrl in controls[:STEPS]:
        crowded.step(ctrl)
    assert crowded.blow_ups.all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda batch: batch.step(np.zeros(46)), "ctrl must be"),
        (lambda batch: batch.step(np.full((WORLDS, 46), np.nan)), "not finite"),
        (lambda batch: batch.step(np.zeros((2, 46)), ids=[2, 0]), "ids must"),
        (lambda batch: batch.reset(np.zeros((2, KEYS))), "qpos must"),
        (lambda batch: batch.reset(ids=[True, False, True]), "ids must"),
        (lambda batch: batch.set_state(np.zeros((WORLDS, 5))), "shape"),
        (lambda batch: batch.set_state(batch.state(), ids=[3]), "ids must"),
    ],
)
def test_wrong_input_changes_nothing(
    change: Callable[[Any], None],
    message: str,
    batch: WorldBatchBase,
    controls: NDArray[np.float64],
) -> None:
    batch.step(controls[0], pedal=True)
    before = batch.state()
    with pytest.raises(ValueError, match=message):
        change(batch)
    np.testing.assert_array_equal(batch.state(), before)
    assert batch.pedal.all()


def test_no_worlds_and_no_gpu(make: Callable[[int], WorldBatchBase]) -> None:
    with pytest.raises(ValueError, match="cannot make 0 worlds"):
        make(0)
    warp = pytest.importorskip("warp")
    if warp.is_cuda_available():
        pytest.skip("there is a GPU")
    with pytest.raises(InputError, match="needs a GPU of NVIDIA") as refused:
        device_batch(1, "cuda")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("device", ["cuda", "warp-cpu"])
def test_a_missing_package_names_its_extra(
    device: DeviceName, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pianomime.world.device_batch.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"needs the package warp: .*install.*\[gpu\]") as refused:
        device_batch(1, device)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("package", "text"),
    [
        ("warp", "raise RuntimeError('no shared\\nlibrary')"),
        ("mujoco_warp", "from mujoco_warp import what_is_not_there"),
        ("mujoco_warp", "of which only a part is"),
    ],
)
def test_a_damaged_package_is_told_in_one_line(package: str, text: str, tmp_path: Path) -> None:
    """In a Python of its own, since modules are imported once."""
    for name in ("warp", "mujoco_warp"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(text if name == package else "")
    script = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from pianomime.errors import InputError\n"
        "from pianomime.world.device_batch import device_batch\n"
        "try: device_batch(1, 'warp-cpu')\n"
        "except InputError as refused: print(refused)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    (line,) = done.stdout.splitlines()
    assert "the device warp-cpu cannot be used: " in line
    assert "[gpu]' --force-reinstall" in line


def test_without_it_warp_is_not_imported() -> None:
    script = (
        "import sys, pianomime, pianomime.learn.envs.batch\n"
        "from pianomime.world.device_batch import device_batch\n"
        "device_batch(1, threads=1)\n"
        "print([name for name in ('warp', 'mujoco_warp') if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_devices_by_name() -> None:
    assert isinstance(device_batch(2, "cpu", 1), WorldBatch)
    unknown: Any = "gpu"
    with pytest.raises(InputError, match="there is no device 'gpu'"):
        device_batch(1, unknown)
