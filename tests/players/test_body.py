"""Body: motions whose speeds, forces and overlaps are known otherwise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

import made_up
from made_up import performed, silent
from pianomime.keyboard import KEYS
from pianomime.players import body
from pianomime.players.body import body_metrics, wrist_and_fingertip_motion
from pianomime.players.motion import motion
from pianomime.world import World
from pianomime.world.layout import LAYOUT
from pianomime.world.model import world_model

DT = 0.005
FRAMES = 40
MIDDLE = world_model().actuator_ctrlrange.mean(axis=1)
OF_POSES = (
    *("hands_overlap", "hands_overlap_max", "fingers_overlap", "fingers_overlap_max"),
    *("forearms_crossed", "wrist_speed_p99", "wrist_jerk", "fingertip_jerk"),
)
OF_MOTION = (
    *("joint_speed_p99", "joint_speed_max", "joints_fast"),
    *("rail_speed_max", "rail_acceleration_max", "rail_force_max"),
    *("forces_at_limit", "forces_at_limit_worst"),
)


def actuator(name: str) -> int:
    return int(world_model().actuator(name).id)


def stepped(ctrl: NDArray[np.float64], joint: str, driven: str) -> Iterator[tuple[float, float]]:
    """Position of a joint before each physics step, and the control that was sent in it."""
    world = World()
    where = world_model().joint(joint).qposadr[0]
    positions: list[float] = []

    def watch() -> None:
        positions.append(float(world.data.qpos[where]))

    for row in ctrl:
        positions[:] = [float(world.data.qpos[where])]
        world.step(row, watch=watch)
        sent = np.repeat(row[:, actuator(driven)], 10 // len(row))
        yield from zip(positions[:-1], sent, strict=True)


def swaying(parts: int) -> NDArray[np.float64]:
    """Controls of a right forearm that goes to and fro along the keyboard."""
    time = np.arange(FRAMES * parts) / (20 * parts)
    ctrl = np.tile(MIDDLE, (FRAMES * parts, 1))
    ctrl[:, actuator("rh_forearm_tx")] = 0.15 + 0.15 * np.sin(6 * time)
    ctrl[:, actuator("lh_forearm_tx")] = -0.2
    return ctrl.reshape(FRAMES, parts, -1)


@pytest.mark.parametrize("parts", [1, 2, 10])
def test_playing_again_gives_the_same_motion(parts: int) -> None:
    ctrl = swaying(parts)
    frames = list(motion(performed(ctrl)))
    assert len(frames) == FRAMES
    world = World()
    for row, moved in zip(ctrl, frames, strict=True):
        np.testing.assert_array_equal(moved.velocity[0], world.qvel_hands)
        world.step(row)
        np.testing.assert_array_equal(moved.velocity[-1], world.qvel_hands)
        np.testing.assert_array_equal(moved.force[-1], world.data.actuator_force)
        assert moved.same


@pytest.mark.parametrize("parts", [1, 5])
def test_rails_are_as_fast_and_pushed_as_hard_as_their_positions_tell(parts: int) -> None:
    ctrl = swaying(parts)
    found = body_metrics(performed(ctrl))
    rows = np.array(list(stepped(ctrl, "rh_forearm_tx", "rh_forearm_tx")))
    left = np.array(list(stepped(ctrl, "lh_forearm_tx", "lh_forearm_tx")))
    speeds = [np.diff(of[:, 0]) / DT for of in (rows, left)]
    assert found.rail_speed_max == pytest.approx(max(np.abs(v).max() for v in speeds), rel=1e-6)
    # From rest.
    changes = [np.abs(np.diff(v, prepend=0)).max() / DT for v in speeds]
    assert found.rail_acceleration_max == pytest.approx(max(changes), rel=1e-6)
    # A position actuator of 900 N/m.
    pushed = [900 * np.abs(of[:, 1] - of[:, 0]).max() for of in (rows, left)]
    assert found.rail_force_max == pytest.approx(max(pushed), rel=1e-6)


def test_forces_at_their_limit_are_counted() -> None:
    ctrl = np.zeros((FRAMES, 1, LAYOUT.ctrl_size))
    ctrl[:, 0, actuator("rh_FFJ3")] = 1.5
    found = body_metrics(performed(ctrl))
    rows = np.array(list(stepped(ctrl, "rh_FFJ3", "rh_FFJ3")))
    # 1 N m/rad, and 1 N m at most.
    share = float((rows[:, 1] - rows[:, 0] >= 1).mean())
    assert 0 < share < 1
    assert found.forces_at_limit_worst == pytest.approx(share)
    # The forearms have no limit.
    assert found.forces_at_limit == pytest.approx(share / 40)


def test_fast_joints_are_told() -> None:
    ctrl = swaying(1)
    low, high = world_model().actuator_ctrlrange[actuator("rh_FFJ3")]
    ctrl[:, 0, actuator("rh_FFJ3")] = np.where(np.arange(FRAMES) % 20 < 10, low, high)
    world = World()
    poses = [world.qpos]
    for row in ctrl:
        world.step(row, watch=lambda: poses.append(world.qpos))
    model = world_model()
    hinges = [
        model.jnt_qposadr[joint]
        for joint in range(KEYS, model.njnt)
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
    ]
    fastest = np.abs(np.diff(np.array(poses)[:, hinges], axis=0)).max(axis=1) / DT
    assert 0 < (fastest > 10).mean() < 1
    found = body_metrics(performed(ctrl))
    assert found.joint_speed_max == pytest.approx(fastest.max(), rel=1e-6)
    assert found.joint_speed_p99 == pytest.approx(np.percentile(fastest, 99), rel=1e-6)
    assert found.joints_fast == pytest.approx((fastest > 10).mean())


def test_controls_at_an_end_are_counted() -> None:
    ctrl = np.tile(MIDDLE, (FRAMES, 2, 1))
    low, high = world_model().actuator_ctrlrange.T
    ctrl[: FRAMES // 2, 0, 3] = low[3]
    ctrl[: FRAMES // 4, :, 30] = high[30] + 1.0
    found = body_metrics(performed(ctrl))
    assert found.controls_at_end == pytest.approx((1 / 4 + 1 / 4) / 46)
    assert found.controls_at_end_worst == pytest.approx(1 / 4)


def test_hands_and_fingers_that_overlap_are_counted() -> None:
    made = silent(FRAMES)
    qpos = np.zeros((FRAMES, LAYOUT.qpos_size))
    model = world_model()
    right, left = (model.joint(f"{side}_forearm_tx").qposadr[0] for side in ("rh", "lh"))
    qpos[:10, left], qpos[:10, right] = 0.2, -0.2  # Past each other.
    qpos[10:14, left], qpos[10:14, right] = 0.14, -0.14
    qpos[20:35, model.joint("lh_FFJ4").qposadr[0]] = 0.3
    qpos[20:35, model.joint("lh_MFJ4").qposadr[0]] = -0.3
    found = body_metrics(replace(made, qpos=qpos))
    assert found.forearms_crossed == pytest.approx(10 / FRAMES)
    assert found.hands_overlap == pytest.approx(4 / FRAMES)
    assert found.fingers_overlap == pytest.approx(15 / FRAMES)
    assert found.hands_overlap_max is not None
    assert found.hands_overlap_max > 0.03
    # Two capsules of 9 mm whose axes meet.
    assert found.fingers_overlap_max == pytest.approx(0.018, abs=1e-4)
    broken = body_metrics(replace(made, qpos=qpos, blow_ups=np.arange(10)))
    assert broken.forearms_crossed == 0
    assert broken.hands_overlap == pytest.approx(4 / 30)


def test_jerk_and_speed_of_a_cubic() -> None:
    time = np.arange(30)[:, None, None, None] / 20
    points = np.zeros((30, 2, 6, 3))
    points[..., 0, :] = time[..., 0, :] ** 3 * [2.0, 0.0, 0.0]
    points[..., 0, 1] += 0.7 * time[..., 0, 0]
    points[..., 1:, :] = time**3 * [0.0, 3.0, 4.0]
    every = np.ones(30, bool)
    found = wrist_and_fingertip_motion(points, every)
    assert found["wrist_speed_p99"] == pytest.approx(0.7)
    assert found["wrist_jerk"] == pytest.approx(6 * 2)
    assert found["fingertip_jerk"] == pytest.approx(6 * 5)
    # A frame that does not count leaves nothing of where it was.
    points[12] += 1.0
    every[12] = False
    assert wrist_and_fingertip_motion(points, every) == pytest.approx(found)


def test_nothing_to_measure_is_no_number() -> None:
    found = wrist_and_fingertip_motion(np.zeros((3, 2, 6, 3)), np.ones(3, bool))
    assert found["wrist_speed_p99"] == 0
    assert found["wrist_jerk"] is None
    made = silent(FRAMES)
    broken = body_metrics(replace(made, blow_ups=np.arange(FRAMES)))
    assert broken.hands_overlap is None
    assert broken.rail_speed_max is None
    assert not set(OF_POSES) & set(broken.invalid)


def test_another_motion_than_was_kept_is_invalid() -> None:
    made = performed(swaying(1))
    whole = body_metrics(made)
    assert not whole.invalid
    qpos = made.qpos.copy()
    qpos[7, KEYS + 3] += 0.01
    found = body_metrics(replace(made, qpos=qpos))
    assert set(found.invalid) == set(OF_MOTION)
    for name in OF_MOTION:
        assert getattr(found, name) is None
        assert getattr(whole, name) is not None
    assert found.controls_at_end == whole.controls_at_end


def test_what_is_not_finite_is_invalid() -> None:
    made = performed(swaying(1))
    qpos = made.qpos.copy()
    qpos[5, KEYS + 1] = np.nan
    assert set(body_metrics(replace(made, qpos=qpos)).invalid) == {*OF_POSES, *OF_MOTION}
    ctrl = made.ctrl.copy()
    ctrl[5, 0, 0] = np.inf
    found = body_metrics(replace(made, ctrl=ctrl))
    assert set(found.invalid) == {*OF_MOTION, "controls_at_end", "controls_at_end_worst"}
    assert found.hands_overlap is not None


def test_every_metric_is_a_number_or_named_invalid() -> None:
    for made in (performed(swaying(1)), made_up.performance(made_up.score())):
        values = asdict(body_metrics(made))
        invalid = values.pop("invalid")
        assert all((value is None) == (name in invalid) for name, value in values.items())
        assert set(body.HUMAN) <= set(values)
