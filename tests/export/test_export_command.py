"""`pianomime export`: the folder, what is printed, and what is refused."""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import made_up
from pianomime.cli import main
from pianomime.export import FILES, samples
from pianomime.export.joints import Joints
from pianomime.music import Score
from pianomime.players.performance import Performance
from pianomime.world.model import world_model


@pytest.fixture(autouse=True)
def saved(performance: Performance, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    performance.save("song.npz")
    return tmp_path


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as stopped:
        main(["export", *arguments])
    assert stopped.value.code == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    return line


def table(path: Path) -> tuple[list[str], np.ndarray]:
    header, *rows = csv.reader(path.read_text("utf-8").splitlines())
    return header, np.array(rows, float)


def test_a_folder_has_everything(
    performance: Performance, saved: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["export", "song.npz"])
    said = capsys.readouterr()
    assert "limits that are broken" in said.out
    assert said.out.splitlines()[-1] == "for a robot: song-export"
    out = saved / "song-export"
    wanted = {*FILES} if "mcap_ros2" in sys.modules else {*FILES} - {"trajectory.mcap"}
    assert {file.name for file in out.iterdir()} == wanted

    joints = Joints.of(world_model(performance.world))
    blocks = list(samples(performance, 100))
    time = np.concatenate([block.time for block in blocks])
    for name, array, units in (
        ("positions.csv", "position", {"rad": "rad", "m": "m"}),
        ("velocities.csv", "velocity", {"rad": "rad/s", "m": "m/s"}),
        ("efforts.csv", "effort", {"rad": "N m", "m": "N"}),
    ):
        header, rows = table(out / name)
        names = [f"{n} [{units[u]}]" for n, u in zip(joints.names, joints.units, strict=True)]
        assert header[: 1 + len(names)] == ["time [s]", *names]
        np.testing.assert_array_equal(rows[:, 0], time)
        values = np.concatenate([getattr(block, array) for block in blocks])
        np.testing.assert_allclose(rows[:, 1 : 1 + len(names)], values, rtol=1e-8, atol=1e-12)
        # J0 is what the tendon measures.
        for column, title in enumerate(header[1 + len(names) :], 1 + len(names)):
            finger, unit = title.split("J0")
            both = [header.index(f"{finger}J{joint}{unit}") for joint in (1, 2)]
            np.testing.assert_allclose(rows[:, column], rows[:, both].sum(axis=1), atol=1e-7)
        assert len(header) == len(rows[0]) == 55 + (0 if name == "efforts.csv" else 8)
    header, rows = table(out / "commands.csv")
    assert header[1:] == [
        f"{n} [{u}]" for n, u in zip(joints.actuators, joints.actuator_units, strict=True)
    ]
    low, high = world_model(performance.world).actuator_ctrlrange.T
    assert (rows[:, 1:] >= low - 1e-8).all()
    assert (rows[:, 1:] <= high + 1e-8).all()

    played = performance.played()
    events = list(csv.DictReader((out / "key_events.csv").read_text("utf-8").splitlines()))
    assert [int(event["pitch"]) - 21 for event in events] == played.key.tolist()
    np.testing.assert_allclose([float(event["on [s]"]) for event in events], played.onset)
    heard = Score.from_midi(out / "performance.mid")
    assert heard.key.tolist() == played.key.tolist()
    assert heard.velocity.tolist() == [int(event["MIDI velocity"]) for event in events]
    for name in ("world.xml", "world.urdf"):
        assert mujoco.MjModel.from_xml_path(str(out / name)).nq == performance.qpos.shape[1]


def test_it_says_how_often_and_how_far_limits_are_broken(performance: Performance) -> None:
    main(["export", "song.npz", "-o", "out", "--rate", "20"])
    broken = list(csv.DictReader(Path("out/broken.csv").read_text("utf-8").splitlines()))
    joints = Joints.of(world_model(performance.world))
    every = np.concatenate([block.velocity for block in samples(performance, 200)])[1:]
    allowed = {"THJ5": 4.0, "THJ4": 4.0}
    for name, speeds in zip(joints.names, np.abs(every).T, strict=True):
        found = [each for each in broken if (each["name"], each["kind"]) == (name, "velocity")]
        if "forearm" in name:
            continue
        limit = allowed.get(name[3:], 2.0)
        assert len(found) == (speeds.max() > limit)
        for each in found:
            assert int(each["physics steps"]) == (speeds > limit).sum()
            assert abs(float(each["worst"])) == pytest.approx(speeds.max())
            assert float(each["at [s]"]) == pytest.approx((speeds.argmax() + 1) / 200)
    assert any(each["kind"] == "velocity" for each in broken)


def test_limits_of_another_robot_are_kept(capsys: pytest.CaptureFixture[str]) -> None:
    main(["export", "song.npz", "-o", "out"])
    capsys.readouterr()
    line = fails(["song.npz", "--strict", "-o", "strict"], capsys)
    assert "limits are broken, most often the" in line
    assert not Path("strict").exists()
    table = list(csv.reader(Path("out/limits.csv").read_text("utf-8").splitlines()))
    with Path("mine.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([table[0], *([*row[:3], "", "", "", ""] for row in table[1:])])
    main(["export", "song.npz", "--limits", "mine.csv", "--strict", "-o", "strict"])
    assert capsys.readouterr().out.splitlines()[-2:] == [
        "all limits are kept",
        "for a robot: strict",
    ]
    assert Path("strict/limits.csv").read_text() == Path("mine.csv").read_text().replace("\r", "")
    assert len(Path("strict/broken.csv").read_text().splitlines()) == 1


def test_another_export_replaces_the_first(performance: Performance) -> None:
    main(["export", "song.npz", "-o", "out"])
    first = {file.name: file.read_bytes() for file in Path("out").iterdir()}
    Path("out/mine.txt").write_text("mine")
    main(["export", "song.npz", "-o", "out"])
    again = {file.name: file.read_bytes() for file in Path("out").iterdir()}
    assert again.pop("mine.txt") == b"mine"
    assert again == first


def test_without_the_extra_there_is_no_log_and_a_line_that_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "pianomime.export.ros_log", raising=False)
    for name in ("mcap_ros2", "mcap_ros2.writer"):
        monkeypatch.setitem(sys.modules, name, None)
    main(["export", "song.npz"])
    note = capsys.readouterr().out.splitlines()[-2]
    assert note.startswith("no trajectory.mcap: it needs the package mcap")
    assert "[robot]" in note
    there = {file.name for file in Path("song-export").iterdir()}
    assert there == {*FILES} - {"trajectory.mcap"}


def test_what_cannot_be_exported_is_one_line(
    performance: Performance, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("text.npz").write_text("no arrays")
    Path("text.csv").write_text("no limits")
    made_up.performance(made_up.score(5)).save("made-up.npz")
    replace(performance, blow_ups=np.array([2])).save("broken.npz")
    assert "not a performance" in fails(["text.npz"], capsys)
    assert "none.npz" in fails(["none.npz"], capsys)
    assert "the physics broke in 1 frame," in fails(["broken.npz"], capsys)
    assert "rate must be 1 to 1000 Hz" in fails(["song.npz", "--rate", "0"], capsys)
    assert "--rate" in fails(["song.npz", "--rate", "fast"], capsys)
    assert "no table of limits" in fails(["song.npz", "--limits", "text.csv"], capsys)
    assert "none.csv" in fails(["song.npz", "--limits", "none.csv"], capsys)
    assert "is a file" in fails(["song.npz", "-o", "text.csv"], capsys)
    assert not [path for path in Path().iterdir() if path.is_dir()]
