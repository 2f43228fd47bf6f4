"""Feedback that keeps hands on a motion, and where keys are found to lie."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pianomime.errors import InputError
from pianomime.keyboard import KEYS
from pianomime.track.calibration import hand_along, keys_aside
from pianomime.track.nominal_tracking import (
    NominalTrackingConfig,
    NominalTrackingController,
    Reference,
)
from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES, Side
from pianomime.world.parameters import SUBSTEPS
from pianomime.world.perturbation import Perturbation, PerturbedWorld, Sensors
from pianomime.world_names import PAPER

FRAMES, CONTROLS = 24, 5


@pytest.fixture(scope="module")
def ctrl() -> np.ndarray:
    """(T, 5, 46) controls that move hands smoothly over the keys, and press some."""
    time = np.arange(FRAMES * CONTROLS)[:, None] / (20 * CONTROLS)
    draw = np.random.default_rng(0)
    size = np.full(LAYOUT.hand_actuators, 0.3)
    size[LAYOUT.slide_actuators] = 0.02
    phase = draw.uniform(0.5, 2.0, LAYOUT.ctrl_size)
    moved: np.ndarray = np.tile(size, 2) * (1 - np.cos(2 * np.pi * phase * time))
    return moved.reshape(FRAMES, CONTROLS, -1)


@pytest.fixture(scope="module")
def reference(ctrl: np.ndarray) -> Reference:
    return Reference.of(ctrl)


def path(
    reference: Reference,
    perturbation: Perturbation,
    config: NominalTrackingConfig | None = None,
    delay: int | None = None,
    aside: float = 0.0,
) -> np.ndarray:
    """(N, 54) positions of the hands after each physics step."""
    world = PerturbedWorld(perturbation, quiet=True)
    late = perturbation.delay_steps if delay is None else delay
    sensors = Sensors(perturbation)
    controller = NominalTrackingController(reference, sensors, config, late, aside)
    controller.settle(world)
    went = []
    for step in range(len(reference.ctrl)):
        world.step(controller.control(step, world), parts=SUBSTEPS)
        went.append(world.qpos_hands)
    return np.array(went)


def error(reference: Reference, went: np.ndarray) -> float:
    return float(np.sqrt(np.mean((went - reference.path[1:]) ** 2)))


NONE = NominalTrackingConfig(proportional=0.0, integral=0.0)


def test_a_reference_is_what_the_nominal_world_does(ctrl: np.ndarray, reference: Reference) -> None:
    world = World(quiet=True)
    for frame, row in enumerate(ctrl):
        np.testing.assert_array_equal(reference.path[frame * SUBSTEPS], world.qpos_hands)
        world.step(row)
    np.testing.assert_array_equal(reference.path[-1], world.qpos_hands)
    np.testing.assert_array_equal(reference.ctrl[3], ctrl[0, 1])


@pytest.mark.parametrize("controls", [1, 5])
def test_where_the_physics_broke_the_path_is_that_of_the_hands(
    ctrl: np.ndarray, controls: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """MuJoCo's reset, to poses that are all zero, is not where the hands were."""
    wanted = ctrl[:8, :controls]
    broken_frame = 5
    hold, held = World._hold, itertools.count()

    def breaks(world: World, *rest: Any) -> None:
        if next(held) == broken_frame * controls:
            world.data.qvel[KEYS + 2] = 1e12
        hold(world, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(World, "_hold", breaks)
        reference = Reference.of(wanted)
        held, world, ends = itertools.count(), World(quiet=True), []
        for row in wanted.reshape(-1, LAYOUT.ctrl_size):
            world.step(row, parts=controls)
            ends.append(world.qpos_hands)
    assert world.blow_ups == 1
    each = SUBSTEPS // controls
    np.testing.assert_array_equal(reference.path[each::each], ends)
    first = broken_frame * SUBSTEPS
    recovered = reference.path[first + 1 : first + each + 1]
    np.testing.assert_array_equal(recovered, np.tile(ends[broken_frame * controls], (each, 1)))
    assert np.count_nonzero(recovered[0]) == 2
    along = [joints.start + LAYOUT.slide - KEYS for joints in LAYOUT.joints]
    np.testing.assert_array_equal(recovered[0, along], reference.path[first, along])


def test_a_reference_needs_frames_and_a_path_of_them(reference: Reference) -> None:
    with pytest.raises(ValueError, match="at least one frame"):
        Reference.of(np.zeros((0, 5, LAYOUT.ctrl_size)))
    with pytest.raises(ValueError, match="ctrl must be"):
        Reference.of(np.zeros((10, LAYOUT.ctrl_size)))
    with pytest.raises(ValueError, match="not 3"):
        Reference(reference.ctrl, reference.path[:3])


def test_nothing_is_added_in_the_nominal_world(reference: Reference) -> None:
    world = World(quiet=True)
    controller = NominalTrackingController(reference, Sensors(Perturbation()))
    for step, sent in enumerate(reference.ctrl):
        given = controller.control(step, world)
        np.testing.assert_array_equal(given, sent)
        world.step(given, parts=SUBSTEPS)


@pytest.mark.parametrize(
    "perturbation",
    [Perturbation(hand_mass=1.1), Perturbation(gain=0.9), Perturbation(gain=1.1)],
)
def test_feedback_keeps_hands_nearer_to_the_reference(
    perturbation: Perturbation, reference: Reference
) -> None:
    replayed = error(reference, path(reference, perturbation, NONE))
    tracked = error(reference, path(reference, perturbation))
    assert tracked < 0.8 * replayed


def test_a_known_delay_is_planned_for(reference: Reference) -> None:
    late = Perturbation(delay=0.05)
    known = error(reference, path(reference, late))
    unknown = error(reference, path(reference, late, delay=0))
    assert known < 0.2 * unknown


def test_a_filter_keeps_noise_from_the_hands(reference: Reference) -> None:
    noisy = Perturbation(joint_noise=0.03, slide_noise=0.003)
    still, steps = World(quiet=True), range(-400, 0)

    def jitter(config: NominalTrackingConfig) -> float:
        controller = NominalTrackingController(reference, Sensors(noisy), config)
        sent = [controller.control(step, still) for step in steps]
        return float(np.std(sent[100:], axis=0).mean())

    proportional = NominalTrackingConfig(integral=0.0)
    assert jitter(proportional) < 0.4 * jitter(replace(proportional, filter=0.0))
    np.testing.assert_array_equal(path(reference, noisy), path(reference, noisy))


def test_noise_of_the_slides_alone_is_not_filtered(reference: Reference) -> None:
    """As the settings say: the filter knows the joints' noise alone."""
    noisy, still = Perturbation(slide_noise=0.003), World(quiet=True)
    config = NominalTrackingConfig(integral=0.0)
    sent = []
    for each in (config, replace(config, filter=0.0)):
        controller = NominalTrackingController(reference, Sensors(noisy), each)
        sent.append([controller.control(step, still) for step in range(-20, 0)])
    np.testing.assert_array_equal(*sent)


def test_hands_go_where_the_keys_lie(reference: Reference) -> None:
    went = path(reference, Perturbation(keys_aside=0.005), aside=0.005)
    for index, side in enumerate(SIDES):
        joints = LAYOUT.among_hands(index)
        shift = (went[-1] - reference.path[-1])[joints]
        assert shift @ hand_along(Hand(side)) == pytest.approx(0.005, abs=0.001)


@pytest.mark.parametrize("side", SIDES)
def test_hands_are_moved_along_the_keyboard(side: Side) -> None:
    hand = Hand(side)
    rest = np.zeros(LAYOUT.hand_joints)
    before = hand.points(rest).copy()
    moved = hand.points(rest + 0.01 * hand_along(hand)) - before
    np.testing.assert_allclose(moved, np.tile([0.0, 0.01, 0.0], (len(moved), 1)), atol=1e-12)


@pytest.mark.parametrize("aside", [-0.012, -0.004, 0.0, 0.003, 0.012])
def test_where_keys_lie_is_found_by_touch(aside: float) -> None:
    world = PerturbedWorld(Perturbation(keys_aside=aside), quiet=True)
    assert keys_aside(world, PAPER) == pytest.approx(aside, abs=0.0006)


@pytest.mark.parametrize(("aside", "neighbour"), [(-0.015, "below"), (0.015, "above")])
def test_keys_that_lie_beyond_the_sweep_are_not_found(aside: float, neighbour: str) -> None:
    world = PerturbedWorld(Perturbation(keys_aside=aside), quiet=True)
    with pytest.raises(InputError, match=f"no key {neighbour} .* than 12 mm") as error:
        keys_aside(world, PAPER)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "wrong",
    [
        {"proportional": -1.0},
        {"most": 0.0},
        {"filter": float("nan")},
        {"settle": 0.125},
        {"settle": -0.05},
    ],
)
def test_wrong_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        replace(NominalTrackingConfig(), **wrong)
