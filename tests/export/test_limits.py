"""Limits: what is broken is found where and when it is, and the table can be edited."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pianomime.errors import InputError
from pianomime.export.limits import Breach, LimitCheck, Limits
from pianomime.export.limits_file import read_limits, write_limits
from pianomime.players.motion import FrameMotion
from pianomime.world.model import world_model

JOINTS, ACTUATORS = 54, 46


@pytest.fixture(scope="module", params=["paper", "solid"])
def limits(request: pytest.FixtureRequest) -> Limits:
    return Limits.of(world_model(request.param))


def still(limits: Limits) -> FrameMotion:
    """A frame in which nothing moves, all joints in the middle of their ranges."""
    middle = (limits.lower + limits.upper) / 2
    return FrameMotion(
        keys=np.zeros((11, 88)),
        position=np.tile(middle, (11, 1)),
        velocity=np.zeros((11, JOINTS)),
        force=np.zeros((10, ACTUATORS)),
        same=True,
    )


def checked(
    limits: Limits, *frames: FrameMotion, command: np.ndarray | None = None
) -> list[Breach]:
    check = LimitCheck(limits)
    for moved in frames:
        rest = np.clip(np.zeros((1, ACTUATORS)), limits.low, limits.high)
        check.see(moved, rest if command is None else command)
    return check.breaches()


def test_limits_are_those_of_the_model(limits: Limits) -> None:
    joint = dict(zip(limits.joints.names, range(JOINTS), strict=True))
    actuator = dict(zip(limits.joints.actuators, range(ACTUATORS), strict=True))
    thumb = joint["lh_THJ4"]
    assert (limits.lower[thumb], limits.upper[thumb]) == (0.0, pytest.approx(1.22173))
    assert (limits.low[actuator["rh_MFJ0"]], limits.high[actuator["rh_MFJ0"]]) == (0.0, 3.1415)
    assert limits.joints.units[joint["rh_forearm_tx"]] == "m"
    # Both joints of a tendon are moved by its actuator.
    for name in ("lh_RFJ1", "lh_RFJ2"):
        assert limits.joints.mover[joint[name]] == actuator["lh_RFJ0"]
        assert joint[name] in limits.joints.coupled[actuator["lh_RFJ0"]]
    assert len(limits.joints.coupled) == 8


def test_speeds_are_those_of_shadows_description(limits: Limits) -> None:
    """Velocity limits of its URDF: 4 rad/s for THJ5 and THJ4, 2 rad/s for all others."""
    speeds = dict(zip(limits.joints.names, limits.velocity, strict=True))
    hand = {name for name in speeds if "forearm" not in name}
    faster = {f"{side}_{joint}" for side in ("rh", "lh") for joint in ("THJ5", "THJ4")}
    assert len(hand) == 2 * 24
    assert {speeds[name] for name in faster} == {4.0}
    assert {speeds[name] for name in hand - faster} == {2.0}


def test_rails_are_as_fast_as_their_motors() -> None:
    rails = [0, 1, 2, 27, 28, 29]
    paper, solid = (Limits.of(world_model(name)) for name in ("paper", "solid"))
    assert all("forearm" in paper.joints.names[rail] for rail in rails)
    assert np.isinf(paper.velocity[rails]).all()
    assert np.isinf(paper.effort[paper.joints.mover[rails]]).all()
    assert (solid.velocity[rails] <= 2.0 + 1e-9).all()
    assert (solid.velocity[rails] > 0.1).all()
    assert (solid.effort[solid.joints.mover[rails]] <= 150.0).all()


def test_what_keeps_its_limits_breaks_none(limits: Limits) -> None:
    frame = still(limits)
    ends = np.where(np.arange(11)[:, None] % 2, limits.lower, limits.upper)
    fast = np.where(np.isinf(limits.velocity), 100.0, limits.velocity)
    hard = np.where(np.isinf(limits.effort), 1000.0, limits.effort)
    moved = frame._replace(
        position=ends, velocity=np.tile(-fast, (11, 1)), force=np.tile(hard, (10, 1))
    )
    command = np.stack([limits.low, limits.high])
    assert checked(limits, moved, moved, command=command) == []


def test_what_is_broken_is_found(limits: Limits) -> None:
    first, second = still(limits), still(limits)
    name, wrist = "rh_WRJ1", limits.joints.names.index("rh_WRJ1")
    first.position[4, wrist] = limits.upper[wrist] + 0.2
    second.position[3:6, wrist] = limits.lower[wrist] - [0.1, 0.3, 0.2]
    # What begins a frame is counted at the end of the one before.
    second.velocity[0, wrist] = 50.0
    second.velocity[10, wrist] = -3.0
    second.force[2, limits.joints.mover[wrist]] = 7.0
    command = np.clip(np.zeros((5, ACTUATORS)), limits.low, limits.high)
    command[4, 3] = limits.high[3] + 0.5
    found = {each.kind: each for each in checked(limits, first, second, command=command)}
    assert found["position"] == Breach(
        name, "position", "rad", limits.lower[wrist], found["position"].worst, 0.07, 4, 0.2
    )
    assert found["position"].worst == pytest.approx(limits.lower[wrist] - 0.3)
    assert found["velocity"] == Breach(name, "velocity", "rad/s", -2.0, -3.0, 0.1, 1, 0.05)
    assert found["effort"] == Breach(
        name, "effort", "N m", limits.effort[limits.joints.mover[wrist]], 7.0, 0.06, 1, 0.05
    )
    assert found["command"].name == limits.joints.actuators[3]
    assert (found["command"].steps, found["command"].at) == (4, pytest.approx(0.04))


def test_the_table_says_what_the_limits_are(limits: Limits, tmp_path: Path) -> None:
    write_limits(limits, tmp_path / "limits.csv")
    again = read_limits(tmp_path / "limits.csv", limits)
    for name in ("lower", "upper", "velocity", "effort", "low", "high"):
        np.testing.assert_allclose(getattr(again, name), getattr(limits, name), rtol=1e-8)


def test_an_edited_table_is_what_counts(limits: Limits, tmp_path: Path) -> None:
    path = tmp_path / "mine.csv"
    write_limits(limits, path)
    text = path.read_text("utf-8")
    joint, actuator = (
        next(line for line in text.splitlines() if line.startswith(of))
        for of in ("joint,lh_FFJ3,", "actuator,lh_FFJ3,")
    )
    text = text.replace(joint, "joint,lh_FFJ3,rad,-0.1,,12.5")
    text = text.replace(actuator, "actuator,lh_FFJ3,rad,0,1,,0.25")
    # As spreadsheets write it.
    path.write_text(text, "utf-8-sig", newline="\r\n")
    mine = read_limits(path, limits)
    place = limits.joints.names.index("lh_FFJ3")
    assert (mine.lower[place], mine.upper[place], mine.velocity[place]) == (-0.1, np.inf, 12.5)
    motor = limits.joints.actuators.index("lh_FFJ3")
    assert (mine.effort[motor], mine.low[motor], mine.high[motor]) == (0.25, 0.0, 1.0)
    others = np.arange(JOINTS) != place
    np.testing.assert_allclose(mine.velocity[others], limits.velocity[others])
    moved = still(limits)
    moved.velocity[1:, place] = 12.0
    moved.force[:, motor] = 0.3
    assert [each.kind for each in checked(replace(limits, velocity=mine.velocity), moved)] == []
    assert [each.kind for each in checked(mine, moved)] == ["effort"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("of,name", "what,name", "no table of limits of these hands"),
        ("joint,rh_FFJ3,", "joint,rh_FFJ9,", "no table of limits of these hands"),
        ("joint,rh_FFJ3,rad,-0.261799,", "joint,rh_FFJ3,rad,low,", "rh_FFJ3 is not a number"),
        ("joint,rh_FFJ3,rad,-0.261799,", "joint,rh_FFJ3,rad,nan,", "rh_FFJ3 is not a finite"),
        ("joint,rh_FFJ3,rad,-0.261799,", "joint,rh_FFJ3,rad,2,", "rh_FFJ3 leave nothing"),
        ("joint,rh_FFJ3,rad,-0.261799,1.5708,2", "joint,rh_FFJ3,rad,0,1,-2", "leave nothing"),
        (
            "joint,rh_FFJ3,rad,-0.261799,1.5708,2,",
            "joint,rh_FFJ3,rad,0,1,2,3",
            "joint rh_FFJ3 has no effort",
        ),
        (
            "actuator,rh_FFJ0,rad,0,3.1415,,",
            "actuator,rh_FFJ0,rad,0,3.1415,5,",
            "rh_FFJ0 has no velocity",
        ),
        ("actuator,", "", "no table of limits of these hands"),
    ],
)
def test_a_table_of_something_else_is_refused(
    old: str, new: str, said: str, limits: Limits, tmp_path: Path
) -> None:
    path = tmp_path / "limits.csv"
    write_limits(limits, path)
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")
    with pytest.raises(InputError, match=said):
        read_limits(path, limits)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"\x89PNG\r\n", b"a" * 2_000_000, b'"'])
def test_a_file_of_another_kind_is_refused(content: bytes, limits: Limits, tmp_path: Path) -> None:
    (tmp_path / "limits.csv").write_bytes(content)
    with pytest.raises(InputError, match="no table of limits"):
        read_limits(tmp_path / "limits.csv", limits)
