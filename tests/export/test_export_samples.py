"""Samples of a performance: those of the physics, and what is between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from pianomime.errors import InputError
from pianomime.export import Samples, samples
from pianomime.keyboard import KEYS
from pianomime.players.performance import Performance
from pianomime.world import World

DT = 0.005


def sampled(performance: Performance, rate: int) -> Samples:
    blocks = zip(*samples(performance, rate), strict=True)
    return Samples(*(np.concatenate(each) for each in blocks))


@pytest.fixture(scope="module")
def physics(performance: Performance) -> Samples:
    return sampled(performance, 200)


def test_at_the_rate_of_the_physics_they_are_its_steps(
    performance: Performance, physics: Samples
) -> None:
    world = World(performance.world)
    rows: list[list[np.ndarray]] = []

    def look() -> None:
        data = world.data
        rows.append([data.qpos[KEYS:].copy(), data.qvel[KEYS:].copy(), data.qpos[:KEYS].copy()])

    look()
    forces, sent = [], []
    for frame in performance.ctrl:
        for control in frame:
            for _ in range(2):
                world.step(control, parts=10, watch=look)
                # Torques and forces on joints, as MuJoCo carries them over tendons.
                forces.append(world.data.qfrc_actuator[KEYS:].copy())
                sent.append(np.clip(control, *world.model.actuator_ctrlrange.T))
    position, velocity, keys = (np.array(each) for each in zip(*rows, strict=True))
    np.testing.assert_array_equal(physics.time, np.arange(121) / 200)
    np.testing.assert_array_equal(physics.position, position)
    np.testing.assert_array_equal(physics.velocity, velocity)
    np.testing.assert_array_equal(physics.keys, keys)
    np.testing.assert_allclose(physics.effort, [*forces, forces[-1]], atol=1e-12)
    np.testing.assert_array_equal(physics.command, [*sent, sent[-1]])


@pytest.mark.parametrize("rate", [1, 7, 20, 30, 100, 125, 500, 1000])
def test_at_any_rate_they_are_on_the_same_way(
    performance: Performance, physics: Samples, rate: int
) -> None:
    found = sampled(performance, rate)
    count = int(0.6 * rate + 1e-9) + 1
    np.testing.assert_array_equal(found.time, np.arange(count) / rate)
    assert all(len(each) == count for each in found)
    way = CubicHermiteSpline(physics.time, physics.position, physics.velocity)
    np.testing.assert_allclose(found.position, way(found.time), atol=1e-9)
    np.testing.assert_allclose(found.velocity, way(found.time, 1), atol=1e-6)
    # What is held in a step, and what is true at its beginning.
    step = np.floor(found.time / DT + 1e-9).astype(int)
    np.testing.assert_array_equal(found.command, physics.command[step])
    np.testing.assert_array_equal(found.effort, physics.effort[step])
    here = np.isclose(found.time, physics.time[step], atol=1e-9)
    np.testing.assert_array_equal(found.position[here], physics.position[step[here]])
    np.testing.assert_array_equal(found.velocity[here], physics.velocity[step[here]])
    for key in (0, 40, KEYS - 1):
        evenly = np.interp(found.time, physics.time, physics.keys[:, key])
        np.testing.assert_allclose(found.keys[:, key], evenly, atol=1e-12)


@pytest.mark.parametrize("rate", [0, -100, 1001])
def test_rates_have_bounds(performance: Performance, rate: int) -> None:
    with pytest.raises(InputError, match=f"rate must be 1 to 1000 Hz, not {rate}"):
        list(samples(performance, rate))


def test_what_no_hands_could_follow_is_refused(performance: Performance) -> None:
    broken = replace(performance, blow_ups=np.array([7, 4]))
    with pytest.raises(InputError, match=r"broke in 2 frames, first at 0\.20 s"):
        list(samples(broken, 100))
    qpos = performance.qpos.copy()
    qpos[3, KEYS + 5] += 0.01
    with pytest.raises(InputError, match=r"lead elsewhere from 0\.15 s on"):
        list(samples(replace(performance, qpos=qpos), 100))
    ctrl = performance.ctrl.copy()
    ctrl[0, 0, 0] = np.nan
    with pytest.raises(InputError, match="not a finite number"):
        list(samples(replace(performance, ctrl=ctrl), 100))
