"""The data factory: what is written is what is played, once, however often it is stopped."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import mido
import numpy as np
import pytest
import zarr

from full_disk import line_on_full_disk
from pianomime import Score, load_player
from pianomime.cli import main
from pianomime.errors import InputError, WorkFailed
from pianomime.learn.data import perform as factory
from pianomime.learn.data.dataset import trajectory_dataset
from pianomime.learn.data.episode import COLUMNS, song_number
from pianomime.learn.data.parts import load_part, parts_folder, parts_in
from pianomime.learn.data.perform import perform
from pianomime.learn.data.perform_worker import load_perform_worker
from pianomime.learn.data.trajectories import TrajectoryData
from pianomime.track import IkTracker
from pianomime.world import World

SECONDS = 1.5


def song(path: Path, *keys: int) -> Path:
    """A MIDI file with a few notes, one after the other."""
    onset = 0.1 + 0.4 * np.arange(len(keys))
    velocity = np.full(len(keys), 80)
    Score(np.array(keys), onset, onset + 0.3, velocity, title=path.stem).to_midi(path)
    return path


@pytest.fixture
def songs(tmp_path: Path) -> Path:
    folder = tmp_path / "songs"
    folder.mkdir()
    song(folder / "one.mid", 40, 44, 47)
    song(folder / "two.mid", 30, 52)
    return folder


def made(songs: Path | list[Path], out: Path, **given: Any) -> factory.Performed:
    paths = songs if isinstance(songs, list) else [songs]
    return perform(paths, out, **{"seconds": SECONDS, "jobs": 1, **given})


def play_alone(songs: Path, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Play all songs, and end before they are put together, as on a disk that is full by then."""

    def full(*_: object) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(factory, "write_trajectories", full)
        with pytest.raises(WorkFailed):
            made(songs, out)


def digests(out: Path) -> dict[str, dict[str, str]]:
    """Of every column of every episode, by name of the song."""
    data = TrajectoryData.open(out)
    return {row["name"]: row["digests"] for row in data.episodes}


def test_episodes_are_what_the_player_plays(songs: Path, tmp_path: Path) -> None:
    out = tmp_path / "songs.zarr"
    done = made(songs, out)
    assert (done.added, done.episodes, done.failed) == (2, 2, [])
    data = TrajectoryData.open(out)
    player = load_player("zero-shot-20hz", 0)
    for number, name in enumerate(("one", "two")):
        performance = player.play(factory_score(songs / f"{name}.mid"))
        assert performance.plan is not None
        episode = data.episode(number)
        columns, events = episode.columns, episode.events
        assert episode.name == name
        assert episode.f1 == pytest.approx(performance.metrics()["f1"])
        np.testing.assert_array_equal(columns["pressed"], performance.pressed)
        np.testing.assert_array_equal(columns["action"], performance.ctrl[:, 0].astype("f4"))
        np.testing.assert_array_equal(columns["goal"], performance.score.roll())
        np.testing.assert_array_equal(columns["finger_key"], performance.plan.finger_key)
        np.testing.assert_array_equal(
            columns["joints"][1:], performance.qpos[:-1, 88:].astype("f4")
        )
        on = events["event_on"]
        np.testing.assert_array_equal(events["event_key"][on], performance.event_key)
        np.testing.assert_array_equal(events["event_time"][on], performance.event_on)
        np.testing.assert_array_equal(events["event_velocity"][on], performance.event_velocity)
        assert (events["event_velocity"][~on] == 0).all()
        assert (np.diff(events["event_time"]) >= 0).all()
        # The base control is the paper's tracker's, asked frame by frame.
        base, world = IkTracker().start(performance.plan), World()
        assert columns["base_control"][0] == pytest.approx(base.control(0, world), abs=1e-6)
        assert episode.source is not None
        assert (episode.source.title, episode.source.player) == (name, player.name)
    assert done.hours == pytest.approx(int(data.ends[-1]) / 20 / 3600)


def factory_score(path: Path) -> Score:
    import pianomime

    return pianomime.excerpt(Score.from_midi(path), 0.0, SECONDS, 0.0)


def test_it_reads_with_zarr_alone_and_has_a_card(songs: Path, tmp_path: Path) -> None:
    out = tmp_path / "songs.zarr"
    (songs / "broken.mid").write_bytes(b"no music")
    done = made(songs, out)
    assert [row["song"] for row in done.failed] == ["broken"]
    data = zarr.open_group(str(out), mode="r")
    ends, event_ends = data["episode_end"][:], data["event_end"][:]
    assert ends[-1] == data["joints"].shape[0]
    assert event_ends[-1] == data["event_key"].shape[0]
    card = (out / "README.md").read_text("utf-8")
    front, rest = card.removeprefix("---\n").split("---\n", 1)
    assert "license: unknown" in front
    assert "2 episodes of 2 songs" in rest
    assert "Songs that could not be played: 1" in rest
    assert "broken" in rest
    for name in TrajectoryData.open(out).episodes[0]:
        assert f"`{name}`" in rest
    for name, column in COLUMNS.items():
        shape = ", ".join(map(str, (ends[-1], *column.shape)))
        assert f"| `{name}` | ({shape}) | {column.dtype} |" in rest
    # The lines that it shows read it.
    code = card.split("```python\n")[1].split("```")[0]
    here = os.getcwd()
    os.chdir(tmp_path)
    try:
        lines: dict[str, Any] = {}
        exec(code, lines)
    finally:
        os.chdir(here)
    assert len(lines["joints"]) == ends[1] - ends[0]


def test_songs_are_told_apart_by_their_music() -> None:
    onset = np.array([0.5, 0.5, 1.0])
    keys = np.array([40, 44, 47])
    score = Score(keys, onset, onset + 0.3, np.full(3, 80), title="a")
    slower = Score(keys, 2 * onset + 3.0, 2 * onset + 3.4, np.full(3, 20), title="b")
    swapped = Score(keys[[1, 0, 2]], onset, onset + 0.3, np.full(3, 80))
    other = Score(keys + 1, onset, onset + 0.3, np.full(3, 80))
    assert song_number(score) == song_number(slower) == song_number(swapped)
    assert song_number(score) != song_number(other)
    assert 0 <= song_number(score) < 2**48


def test_more_songs_are_added_and_a_copy_is_not(songs: Path, tmp_path: Path) -> None:
    out = tmp_path / "songs.zarr"
    made([songs / "one.mid"], out)
    before = digests(out)
    for name in ("copy", "other"):
        (songs / f"{name}.mid").write_bytes((songs / "one.mid").read_bytes())
    with pytest.warns(UserWarning, match="one.mid and 1 more: the same content as another file"):
        done = made(songs, out)
    for name in ("copy", "other"):
        (songs / f"{name}.mid").unlink()
    assert (done.added, done.episodes) == (1, 2)
    after = digests(out)
    assert {**after, **before} == after
    assert set(after) == {"one", "two"}
    # Nothing is left to do: the data set stays as it is, to the byte.
    written = (out / "zarr.json").stat().st_mtime_ns
    assert made(songs, out).added == 0
    assert (out / "zarr.json").stat().st_mtime_ns == written
    assert [each.name for each in tmp_path.iterdir()].count("songs.zarr.parts") == 0


def test_other_settings_are_refused_in_one_line(songs: Path, tmp_path: Path) -> None:
    out = tmp_path / "songs.zarr"
    made(songs, out)
    for given, named in (({"seed": 1}, "seed 0, not 1"), ({"seconds": 1.0}, "seconds 1.5, not 1")):
        with pytest.raises(InputError, match=f"was made with {named}") as error:
            made(songs, out, **given)
        assert "\n" not in str(error.value)
    assert len(TrajectoryData.open(out)) == 2


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"player": "zero-shot"}, "one control a frame, not 5"),
        ({"effort": 1, "noise": 0.1}, "any state"),
        ({"player": "demonstration"}, "plays no MIDI files"),
        ({"noise": 2.0}, "noise"),
        ({"seed": -1}, "seed"),
        ({"seconds": 0.0}, "seconds"),
    ],
)
def test_what_makes_no_data_set_is_refused_at_once(
    songs: Path, tmp_path: Path, given: dict[str, Any], message: str
) -> None:
    out = tmp_path / "songs.zarr"
    with pytest.raises(InputError, match=message) as error:
        made(songs, out, **given)
    assert "\n" not in str(error.value)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["songs"]


@pytest.mark.parametrize(
    ("names", "split", "suggested"),
    [(["one", "two"], "train", True), (["one"], "train", False), (["one", "two"], "test", False)],
)
def test_a_training_is_suggested_where_it_can_be_done(
    songs: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    names: list[str],
    split: str,
    suggested: bool,
) -> None:
    monkeypatch.chdir(tmp_path)
    paths = [str(songs / f"{name}.mid") for name in names]
    options = ["--split", split, "--seconds", str(SECONDS), "--jobs", "1"]
    main(["perform", *paths, "-o", "songs.zarr", *options])
    (*_, last) = capsys.readouterr().out.splitlines()
    _, found, suggestion = last.partition("train a policy of it: pianomime ")
    assert bool(found) == suggested
    if suggested:
        trained: list[str] = []

        def train(name: str, *_: object) -> Path:
            trained.append(name)
            return Path("policy.onnx")

        monkeypatch.setattr("pianomime.learn.imitation.training.train_policy", train)
        # What it needs is there.
        main(suggestion.split())
        assert trained == ["low-mse"]


def test_what_fails_is_told_and_the_rest_is_kept(
    songs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "songs.zarr"
    (songs / "broken.mid").write_bytes(b"no music")
    Score(np.zeros(0, int), np.zeros(0), np.zeros(0), np.zeros(0, int)).to_midi(
        songs / "silent.mid"
    )
    arguments = ["perform", str(songs), "-o", str(out), "--seconds", str(SECONDS), "--jobs", "1"]
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 1
    said = capsys.readouterr()
    assert "failed: broken: " in said.out
    assert "failed: silent: " in said.out
    assert said.err.splitlines()[-1].startswith("pianomime: 2 songs could not be played")
    data = TrajectoryData.open(out)
    assert len(data) == 2
    assert [row["song"] for row in data.making.failed] == ["broken", "silent"]
    # What was mended is played, and no failure any more.
    song(songs / "broken.mid", 41, 43)
    (songs / "silent.mid").unlink()
    assert made(songs, out).failed == []
    assert [row["song"] for row in TrajectoryData.open(out).making.failed] == ["silent"]


def test_nothing_that_can_be_played(tmp_path: Path) -> None:
    (tmp_path / "broken.mid").write_bytes(b"no music")
    with pytest.raises(WorkFailed, match="no song could be played: broken: "):
        made([tmp_path / "broken.mid"], tmp_path / "songs.zarr")
    assert [each.name for each in tmp_path.iterdir()] == ["broken.mid"]


def test_what_is_for_tests_is_never_trained_on(songs: Path, tmp_path: Path) -> None:
    out = tmp_path / "songs.zarr"
    made([songs / "one.mid"], out, split="test")
    slower = Score.from_midi(songs / "one.mid")
    slower = dataclasses.replace(slower, onset=slower.onset * 1.5, offset=slower.offset * 1.5)
    slower.to_midi(songs / "slower.mid")
    done = made(songs, out)
    # Neither the file itself, nor another one of the same music.
    assert done.elsewhere == [{"song": "one", "error": "is there already, of the split test"}]
    assert done.failed == [
        {"song": "slower", "error": "is the same music as another song, of the split test"}
    ]
    assert trajectory_dataset([out]).name == ["two"]
    # What is there, if as something else, is not missing.
    assert [row["song"] for row in TrajectoryData.open(out).making.failed] == ["slower"]


def test_with_noise_the_action_is_the_experts(songs: Path, tmp_path: Path) -> None:
    plain, noisy = tmp_path / "plain.zarr", tmp_path / "noisy.zarr"
    made([songs / "one.mid"], plain)
    made([songs / "one.mid"], noisy, noise=0.2)
    episode = TrajectoryData.open(noisy).episode(0)
    quiet = TrajectoryData.open(plain).episode(0)
    assert not np.allclose(episode.columns["joints"], quiet.columns["joints"], atol=1e-3)
    # In the state that it got into, the player would do this.
    controller = load_player("zero-shot-20hz", 0).start(factory_score(songs / "one.mid"))
    world = World()
    for frame in range(3):
        assert episode.columns["action"][frame] == pytest.approx(
            controller.control(frame, at(world, episode.columns, frame)), abs=1e-3
        )
    # The noise of a song does not depend on what else is played.
    both = tmp_path / "both.zarr"
    made(songs, both, noise=0.2)
    assert digests(both)["one"] == digests(noisy)["one"]


def at(world: World, columns: dict[str, Any], frame: int) -> World:
    """A world with the hands of a row; keys are up in the first frames."""
    world.data.qpos[88:] = columns["joints"][frame]
    world.data.qvel[88:] = columns["velocities"][frame]
    return world


def command(songs: Path, out: Path) -> list[str]:
    given = [str(songs), "-o", str(out), "--seconds", str(SECONDS), "--jobs", "1"]
    return [sys.executable, "-m", "pianomime", "perform", *given]


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A folder of songs, and the digests of what is made of them."""
    folder = tmp_path_factory.mktemp("songs")
    for number in range(4):
        song(folder / f"{number}.mid", 35 + number, 50 - number)
    out = tmp_path_factory.mktemp("whole") / "songs.zarr"
    made(folder, out)
    return folder, digests(out)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signals")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_killed_it_goes_on_and_comes_to_the_same(
    uninterrupted: tuple[Path, dict[str, Any]], tmp_path: Path, number: signal.Signals
) -> None:
    songs, whole = uninterrupted
    out = tmp_path / "songs.zarr"
    process = subprocess.Popen(command(songs, out), stderr=subprocess.PIPE, text=True)
    folder = parts_folder(out)
    while not parts_in(folder) and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(number)
    _, said = process.communicate()
    assert process.returncode in (-number, 128 + number)
    if number == signal.SIGINT:
        assert said.splitlines() == ["pianomime: stopped; the same command goes on where it was"]
    finished = {part: part.stat().st_mtime_ns for part in parts_in(folder)}
    assert 1 <= len(finished) < len(whole)
    assert not out.exists()
    with pytest.raises(InputError, match="was made with seed 0, not 1"):
        made(songs, out, seed=1)
    assert {part: part.stat().st_mtime_ns for part in parts_in(folder)} == finished
    # One that is damaged is played again.
    broken = min(finished)
    broken.write_bytes(broken.read_bytes()[:-100])
    with pytest.warns(UserWarning, match="played again"):
        done = made(songs, out)
    assert (done.added, done.failed) == (len(whole), [])
    assert digests(out) == whole
    assert [each.name for each in tmp_path.iterdir()] == [out.name]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limits")
def test_a_full_disk_is_one_line_and_loses_nothing(songs: Path, tmp_path: Path) -> None:
    out = tmp_path / "songs.zarr"
    line = line_on_full_disk(command(songs, out), 20_000)
    assert line.startswith("pianomime: one.mid: cannot be kept: File too large")
    assert [each.name for each in tmp_path.iterdir()] == ["songs"]


def test_a_disk_that_is_full_at_the_end_loses_nothing(
    songs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "songs.zarr"

    def full(*_: object) -> int:
        raise OSError(28, "No space left on device", "a/long/way/to/a/chunk")

    with monkeypatch.context() as patch:
        patch.setattr(factory, "write_trajectories", full)
        with pytest.raises(
            WorkFailed, match="No space left on device; all that was played"
        ) as error:
            made(songs, out)
    assert "\n" not in str(error.value)
    kept = parts_in(parts_folder(out))
    assert [load_part(part).name for part in kept] == ["one", "two"]
    times = [part.stat().st_mtime_ns for part in kept]

    def untouched(path: Path) -> Any:
        assert path.stat().st_mtime_ns in times
        return load_part(path)

    with monkeypatch.context() as patch:
        patch.setattr(factory, "load_part", untouched)
        assert made(songs, out).added == 2
    assert not parts_folder(out).exists()


def test_a_cluster_makes_the_same(
    uninterrupted: tuple[Path, dict[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("ray", reason="the extra scale is not installed")
    monkeypatch.setenv("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")
    songs, whole = uninterrupted
    monkeypatch.chdir(tmp_path)
    made(songs, Path("songs.zarr"), ray="local")
    assert digests(Path("songs.zarr")) == whole


def test_what_is_in_the_way_stays(songs: Path, tmp_path: Path) -> None:
    out = tmp_path / "songs.zarr"
    folder = parts_folder(out)
    folder.mkdir()
    (folder / "letters.txt").write_text("dear")
    with pytest.raises(InputError, match="something else than parts"):
        made(songs, out)
    assert (folder / "letters.txt").read_text() == "dear"


def test_one_that_physics_broke_in_is_a_failure(
    songs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = {
        **{"player": "zero-shot-20hz", "effort": 0, "seed": 0, "world": None, "settings": {}},
        **{"seconds": SECONDS, "lead_in": 0.0, "noise": 0.0},
    }
    answer = load_perform_worker(setup)
    monkeypatch.setattr(World, "blow_ups", property(lambda _: 3, lambda *_: None), raising=False)
    part = tmp_path / "part.npz"
    task = {"song": str(songs / "one.mid"), "digest": "00" * 32, "part": str(part)}
    with pytest.raises(InputError, match="the physics broke in 3 of "):
        answer({**task, "split": "train"})
    assert not part.exists()


def test_what_is_left_out_of_a_song_is_told(songs: Path, tmp_path: Path) -> None:
    midi = mido.MidiFile(songs / "one.mid")
    track = midi.tracks[-1]
    for kind in ("note_on", "note_off"):
        track.insert(-1, mido.Message(kind, note=120, velocity=64, time=100))
    midi.save(songs / "one.mid")
    with pytest.warns(UserWarning, match=r"one\.mid: 1 of 4 notes are outside the range"):
        assert made(songs, tmp_path / "songs.zarr").added == 2


def test_a_damaged_part_of_a_song_that_is_not_named_is_left_out(
    songs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "songs.zarr"
    play_alone(songs, out, monkeypatch)
    one, _ = parts_in(parts_folder(out))
    one.write_bytes(one.read_bytes()[:-100])
    with pytest.warns(UserWarning, match="left out and removed: its song has"):
        assert made([songs / "two.mid"], out).added == 1
    assert set(digests(out)) == {"two"}
    assert made(songs, out).added == 1
    assert set(digests(out)) == {"one", "two"}


def test_a_song_that_was_renamed_meanwhile_is_in_it_once(
    songs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "songs.zarr"
    play_alone(songs, out, monkeypatch)
    (songs / "one.mid").rename(songs / "first.mid")
    result = made(songs, out)
    assert (result.added, result.episodes) == (2, 2)
    assert set(digests(out)) == {"one", "two"}


@pytest.mark.parametrize("seed", [-1, 2**63, 2**64])
def test_a_seed_that_cannot_be_kept_is_refused_at_once(
    songs: Path, tmp_path: Path, seed: int
) -> None:
    with pytest.raises(InputError, match="seed must be 0 to 9223372036854775807"):
        made(songs, tmp_path / "songs.zarr", seed=seed)
    assert not (tmp_path / "songs.zarr.parts").exists()


def test_a_damaged_data_set_costs_nothing_of_what_is_played(songs: Path, tmp_path: Path) -> None:
    out = tmp_path / "songs.zarr"
    made([songs / "one.mid"], out)
    chunk = next(each for each in (out / "joints" / "c").rglob("*") if each.is_file())
    chunk.unlink()
    with pytest.raises(InputError, match=r"damaged .*; all that was played is kept in"):
        made(songs, out)
    assert len(parts_in(parts_folder(out))) == 1


def test_a_data_set_that_was_set_aside_by_a_killed_process_is_added_to(
    songs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "songs.zarr"
    made([songs / "one.mid"], out)
    replace = os.replace

    class Killed(BaseException):
        """What ends a process at once."""

    def killed(source: Path, target: Path) -> None:
        replace(source, target)
        if Path(source) == out:
            raise Killed

    with monkeypatch.context() as patch:
        patch.setattr("pianomime.files.os.replace", killed)
        with pytest.raises(Killed):
            made(songs, out)
    assert not out.exists()
    assert made(songs, out).episodes == 2
    assert set(digests(out)) == {"one", "two"}
    assert sorted(each.name for each in tmp_path.iterdir()) == ["songs", "songs.zarr"]


@pytest.mark.parametrize("place", [".", "..", "/"])
def test_a_place_without_a_name_is_refused(
    songs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    made([songs / "one.mid"], tmp_path / "songs.zarr")
    monkeypatch.chdir(tmp_path / "songs.zarr")
    with pytest.raises(InputError, match="give the folder a name"):
        made(songs, Path(place))
    assert len(TrajectoryData.open(tmp_path / "songs.zarr")) == 1


def test_a_full_disk_at_the_very_start_leaves_nothing(
    songs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> str:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pianomime.learn.data.parts.sealed", full)
    with pytest.raises(OSError, match="No space left"):
        made(songs, tmp_path / "songs.zarr")
    assert [each.name for each in tmp_path.iterdir()] == ["songs"]


def test_a_data_set_of_other_origin_is_not_added_to(songs: Path, tmp_path: Path) -> None:
    out = tmp_path / "songs.zarr"
    made(songs, out)
    group = json.loads((out / "zarr.json").read_text())
    group["attributes"]["version"] = 4
    (out / "zarr.json").write_text(json.dumps(group))
    with pytest.raises(InputError, match="version 4") as error:
        made(songs, out)
    assert "\n" not in str(error.value)
    assert not parts_folder(out).exists()
