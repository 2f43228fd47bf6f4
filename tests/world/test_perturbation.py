"""Worlds that differ from the nominal one: by what, by how much, and by nothing else."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from pianomime.errors import InputError
from pianomime.keyboard import KEYS
from pianomime.world import World
from pianomime.world.layout import LAYOUT
from pianomime.world.model import world_model
from pianomime.world.parameters import PHYSICS_DT, SUBSTEPS, key_centres
from pianomime.world.perturbation import Perturbation, PerturbedWorld, Sensors

ALL = Perturbation(friction=0.7, hand_mass=1.1, gain=0.9, key_stiffness=1.2, keys_aside=0.002)


def controls(frames: int) -> np.ndarray:
    """(T, 46) that press keys here and there."""
    return np.random.default_rng(0).uniform(-0.3, 0.6, (frames, LAYOUT.ctrl_size))


def test_without_a_difference_it_is_the_nominal_world_bit_for_bit() -> None:
    nominal, same = World(quiet=True), PerturbedWorld(Perturbation(), quiet=True)
    for ctrl in controls(20):
        nominal.step(ctrl)
        same.step(ctrl)
        np.testing.assert_array_equal(same.qpos, nominal.qpos)
        for one, other in zip(same.key_events, nominal.key_events, strict=True):
            np.testing.assert_array_equal(one, other)


def test_models_differ_by_what_they_are_said_to_and_the_nominal_one_stays() -> None:
    nominal = world_model()
    before = nominal.body_mass.copy(), nominal.geom_friction.copy(), nominal.body_pos.copy()
    model = ALL.model()
    for array, kept in zip(
        (nominal.body_mass, nominal.geom_friction, nominal.body_pos), before, strict=True
    ):
        np.testing.assert_array_equal(array, kept)
    hand, key = nominal.body("rh_palm").id, nominal.body("key_40").id
    np.testing.assert_allclose(model.geom_friction, 0.7 * nominal.geom_friction)
    np.testing.assert_allclose(model.body_mass[hand], 1.1 * nominal.body_mass[hand])
    np.testing.assert_allclose(model.body_mass[key], nominal.body_mass[key])
    weight = model.body_mass * model.body_gravcomp
    np.testing.assert_allclose(weight, nominal.body_mass * nominal.body_gravcomp)
    np.testing.assert_allclose(
        model.jnt_stiffness[:KEYS], 1.2 * np.asarray(nominal.jnt_stiffness)[:KEYS]
    )
    np.testing.assert_allclose(
        np.asarray(model.jnt_stiffness)[KEYS:], np.asarray(nominal.jnt_stiffness)[KEYS:]
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    along = [data.body(f"key_{number}").xpos[1] for number in range(KEYS)]
    np.testing.assert_allclose(along, key_centres()[:, 1] + 0.002)


def test_a_weaker_spring_is_still_at_rest_where_it_is_told_to_be() -> None:
    target = np.zeros(LAYOUT.ctrl_size)
    target[LAYOUT.actuators[1]][LAYOUT.slide_actuators.start] = 0.05
    world = PerturbedWorld(Perturbation(gain=0.9), quiet=True)
    nominal = World(quiet=True)
    for _ in range(80):
        world.step(target)
        nominal.step(target)
    np.testing.assert_allclose(world.qpos_hands, nominal.qpos_hands, atol=2e-3)


def test_heavier_hands_sag() -> None:
    world, nominal = PerturbedWorld(Perturbation(hand_mass=1.1), quiet=True), World(quiet=True)
    for _ in range(20):
        world.step(np.zeros(LAYOUT.ctrl_size))
        nominal.step(np.zeros(LAYOUT.ctrl_size))
    assert (world.fingertips[..., 2] < nominal.fingertips[..., 2] - 1e-4).all()


@pytest.mark.parametrize("steps", [1, 5, 10, 13])
def test_controls_act_later_by_the_delay(steps: int) -> None:
    late = PerturbedWorld(Perturbation(delay=steps * PHYSICS_DT), quiet=True)
    nominal = World(quiet=True)
    sent = np.repeat(controls(6), SUBSTEPS, axis=0)
    rest = np.zeros((steps, LAYOUT.ctrl_size))
    for ctrl, acting in zip(sent, np.concatenate([rest, sent]), strict=False):
        late.step(ctrl, parts=SUBSTEPS)
        nominal.step(acting, parts=SUBSTEPS)
        np.testing.assert_array_equal(late.qpos, nominal.qpos)


def test_a_frame_that_is_sent_at_once_is_delayed_as_its_parts_are() -> None:
    whole, parts = (PerturbedWorld(Perturbation(delay=0.025), quiet=True) for _ in range(2))
    for ctrl in controls(6).reshape(3, 2, -1):
        whole.step(ctrl)
        for part in ctrl:
            parts.step(part, parts=2)
    np.testing.assert_array_equal(whole.qpos, parts.qpos)


def test_a_reset_forgets_what_was_sent() -> None:
    world = PerturbedWorld(Perturbation(delay=0.05), quiet=True)
    world.step(controls(1)[0])
    world.reset()
    world.step(np.zeros(LAYOUT.ctrl_size))
    still = World(quiet=True)
    still.step(np.zeros(LAYOUT.ctrl_size))
    np.testing.assert_array_equal(world.qpos, still.qpos)


def test_a_state_that_is_restored_forgets_what_was_sent() -> None:
    world = PerturbedWorld(Perturbation(delay=0.05), quiet=True)
    still = world.state()
    world.step(controls(1)[0])
    world.set_state(still)
    world.step(np.zeros(LAYOUT.ctrl_size))
    rested = World(quiet=True)
    rested.set_state(still)
    rested.step(np.zeros(LAYOUT.ctrl_size))
    np.testing.assert_array_equal(world.qpos, rested.qpos)


def test_a_copy_goes_on_as_its_world_does() -> None:
    """Bit for bit, with the controls that wait, and in the middle of a frame."""
    world = PerturbedWorld(replace(ALL, delay=0.035), quiet=True)
    sent = np.repeat(controls(6), 2, axis=0)
    for ctrl in sent[:5]:
        world.step(ctrl, parts=2)
    other = world.copy(quiet=True)
    assert (other.perturbation, other.model is world.model) == (world.perturbation, True)
    went = []
    for each in (world, other):  # One after the other: what waits belongs to each alone.
        for ctrl in sent[5:]:
            each.step(ctrl, parts=2)
        went.append(each.state())
    np.testing.assert_array_equal(*went)
    again = other.copy().copy()
    for each in (other, again):
        each.step(sent[0])
    np.testing.assert_array_equal(again.state(), other.state())


@pytest.mark.parametrize("steps", range(60))
def test_every_whole_number_of_steps_is_a_delay(steps: int) -> None:
    assert Perturbation(delay=steps * PHYSICS_DT).delay_steps == steps
    assert Perturbation(delay=round(0.005 * steps, 3)).delay_steps == steps


def test_sensors_are_as_noisy_as_they_are_said_to_be() -> None:
    world = World(quiet=True)
    noisy = Perturbation(joint_noise=0.03, slide_noise=0.003)
    sensors, again = Sensors(noisy, seed=1), Sensors(noisy, seed=1)
    measured = np.array([sensors.measure(world) for _ in range(2000)])
    np.testing.assert_array_equal(again.measure(world), measured[0])
    assert not np.array_equal(Sensors(noisy, seed=2).measure(world), measured[0])
    spread = measured.std(axis=0).reshape(2, -1)
    slides = spread[:, LAYOUT.slides]
    np.testing.assert_allclose(slides, 0.003, rtol=0.1)
    np.testing.assert_allclose(np.delete(spread, LAYOUT.slides, axis=1), 0.03, rtol=0.1)
    np.testing.assert_allclose(measured.mean(axis=0), world.qpos_hands, atol=0.003)
    exact = Sensors(Perturbation()).measure(world)
    np.testing.assert_array_equal(exact, world.qpos_hands)


@pytest.mark.parametrize(
    "wrong",
    [
        {"friction": 0.0},
        {"hand_mass": -1.0},
        {"gain": float("nan")},
        {"key_stiffness": float("inf")},
        {"keys_aside": 1.0},
        {"joint_noise": -0.1},
        {"slide_noise": float("nan")},
        {"delay": -0.005},
        {"delay": 0.002},
        {"delay": 0.0126},
    ],
)
def test_what_cannot_be_is_refused_in_one_line(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong)).replace("_", "-")):
        replace(Perturbation(), **wrong)
