"""Exports for LeRobot and Minari: what is read from them is what the data set says."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pianomime.cli import main
from pianomime.errors import InputError
from pianomime.learn.data.episode import COLUMNS, Episode
from pianomime.learn.data.trajectories import TrajectoryData, write_trajectories
from pianomime.learn.export.data_export import MARK, DataFormat, export_data
from pianomime.learn.export.feature_stats import RunningStats, episode_stats
from pianomime.learn.export.named_rows import GOAL_FRAMES, names, rows
from pianomime.world import World
from pianomime.world_names import PAPER, WORLDS

SONGS = (("rise", "train", 7, 3), ("fall", "test", 5, 4), ("rise", "train", 2, 3))
"""Name, split, frames and number of the song of each episode."""


def made_up_episodes() -> Iterator[Episode]:
    """Episodes of random numbers."""
    random = np.random.default_rng(0)
    for name, split, frames, song in SONGS:
        columns = {
            column_name: random.integers(0, 2, (frames, *column.shape)).astype(column.dtype)
            if column.dtype in ("bool", "int8")
            else random.normal(size=(frames, *column.shape)).astype(column.dtype)
            for column_name, column in COLUMNS.items()
        }
        yield Episode(name, 0.5, "dynamic", columns, song, split)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("data") / "made-up.zarr"
    write_trajectories(path, made_up_episodes())
    return path


@pytest.mark.parametrize("world", WORLDS)
def test_numbers_have_names_of_their_own(world: str) -> None:
    named = names(world)
    made = rows(next(made_up_episodes()).columns)
    assert {name: len(each) for name, each in named.items()} == {
        name: array[0].size for name, array in made.items()
    }
    every = [name for each in named.values() for name in each]
    assert len(set(every)) == len(every)


def test_names_are_of_the_numbers() -> None:
    world, named = World(PAPER, quiet=True), names(PAPER)
    for number in (0, 10, 53):
        before = world.qpos_hands.copy()
        joint = world.model.joint(named["joints"][number].split()[0])
        world.data.qpos[joint.qposadr] += 0.25
        assert np.flatnonzero(world.qpos_hands != before).tolist() == [number]
    actuators = [world.model.actuator(at).name for at in range(world.model.nu)]
    assert [name.split()[0] for name in named["action"]] == actuators
    assert named["goals"][88 + 39] == "key C4 wanted, frame +1 [0 or 1]"
    at = np.ravel_multi_index((2, 1, 5, 2), (GOAL_FRAMES, 2, 6, 3))
    assert named["fingertips"][at] == "right little z, frame +2 [m]"


def test_goals_are_those_of_the_frames_ahead() -> None:
    columns = next(made_up_episodes()).columns
    made, last = rows(columns), len(columns["goal"]) - 1
    for ahead in range(GOAL_FRAMES):
        there = last + 1 - ahead
        np.testing.assert_array_equal(made["goals"][:there, ahead], columns["goal"][ahead:])
        np.testing.assert_array_equal(
            made["fingertips"][:there, ahead], columns["fingertips"][ahead:]
        )
        # After the end no key is wanted, and hands stay.
        assert not made["goals"][there:, ahead].any()
        assert (made["fingertips"][there:, ahead] == columns["fingertips"][last]).all()


def test_statistics_of_parts_are_those_of_the_whole() -> None:
    values = np.random.default_rng(1).normal(3, 2, (101, 4))
    running = RunningStats(len(values))
    for part in np.split(values, [1, 40, 42]):
        running.add({"x": part}, {"x": episode_stats(part)})
    whole = episode_stats(values)
    for stat, found in running.of_all()["x"].items():
        np.testing.assert_allclose(found, whole[stat], rtol=1e-12, err_msg=stat)


def test_lerobot_reads_what_was_written(data: TrajectoryData, tmp_path: Path) -> None:
    """By the rules of LeRobotDataset v3.0, and with Parquet's own reader."""
    pq = pytest.importorskip("pyarrow.parquet", reason="the extra data is not installed")
    out = tmp_path / "made-up"
    export_data(data, out, "lerobot")
    info = json.loads((out / "meta/info.json").read_text("utf-8"))
    assert (info["codebase_version"], info["fps"]) == ("v3.0", 20)
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, 14, 2)
    assert info["splits"] == {"train": "0:2", "test": "2:3"}
    tasks = pq.read_table(out / "meta/tasks.parquet")
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    task_of = dict(zip(tasks["task_index"].to_pylist(), tasks["task"].to_pylist(), strict=True))
    episodes = [
        row
        for file in sorted((out / "meta/episodes").glob("*/*.parquet"))
        for row in pq.read_table(file).to_pylist()
    ]
    stats = json.loads((out / "meta/stats.json").read_text("utf-8"))
    every: dict[str, list[np.ndarray]] = {name: [] for name in info["features"]}
    order = [0, 2, 1]
    assert [row["episode_index"] for row in episodes] == [0, 1, 2]
    for row, number in zip(episodes, order, strict=True):
        name, split, frames, song = SONGS[number]
        assert (row["tasks"], row["split"], row["song_id"]) == ([name], split, song)
        place = {part: row[f"data/{part}"] for part in ("chunk_index", "file_index")}
        table = pq.read_table(out / info["data_path"].format(**place))
        first, end = row["dataset_from_index"], row["dataset_to_index"]
        assert end - first == row["length"] == frames
        columns = {each: np.array(table[each].to_pylist())[first:end] for each in info["features"]}
        np.testing.assert_array_equal(columns["index"], np.arange(first, end))
        np.testing.assert_array_equal(columns["frame_index"], np.arange(frames))
        np.testing.assert_allclose(columns["timestamp"], np.arange(frames) / 20, atol=1e-6)
        assert {task_of[index] for index in columns["task_index"]} == {name}
        assert set(columns["episode_index"]) == {row["episode_index"]}
        played = data.columns(number, COLUMNS)
        state = np.hstack([played["joints"], played["velocities"], played["keys"]])
        np.testing.assert_array_equal(columns["observation.state"], state)
        np.testing.assert_array_equal(columns["action"], played["action"])
        wanted = columns["observation.environment_state"][:, : played["goal"].shape[1]]
        np.testing.assert_array_equal(wanted, played["goal"])
        for feature, values in columns.items():
            values = values.reshape(frames, -1)
            every[feature].append(values)
            assert info["features"][feature]["shape"] == [values.shape[1]]
            assert row[f"stats/{feature}/count"] == [frames]
            np.testing.assert_allclose(row[f"stats/{feature}/mean"], values.mean(0), atol=1e-6)
    for feature, parts in every.items():
        values = np.concatenate(parts).astype(float)
        np.testing.assert_allclose(stats[feature]["std"], values.std(0), atol=1e-6)
        np.testing.assert_allclose(stats[feature]["q10"], np.quantile(values, 0.1, 0), atol=1e-6)
    assert sum(1 for _ in (out / "data").rglob("*.parquet")) == 1


def test_lerobot_is_written_where_a_name_is_no_utf8(data: TrajectoryData, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow", reason="the extra data is not installed")
    odd, plain = tmp_path / os.fsdecode(b"e \xff"), tmp_path / "plain"
    try:
        odd.mkdir()
    except OSError:
        pytest.skip("this file system allows no such name")
    odd.rmdir()
    for out in (odd, plain):
        export_data(data, out, "lerobot")
    assert {file.relative_to(odd): file.read_bytes() for file in odd.rglob("*.*")} == {
        file.relative_to(plain): file.read_bytes() for file in plain.rglob("*.*")
    }


def test_files_and_chunks_are_begun_where_one_is_full(
    data: TrajectoryData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pq = pytest.importorskip("pyarrow.parquet", reason="the extra data is not installed")
    monkeypatch.setattr("pianomime.learn.export.lerobot._FILE_MIB", 1e-6)
    monkeypatch.setattr("pianomime.learn.export.numbered_files.FILES_IN_CHUNK", 2)
    export_data(data, tmp_path / "out", "lerobot")
    for kind in ("data", "meta/episodes"):
        files = sorted((tmp_path / "out" / kind).rglob("*.parquet"))
        assert [str(file.relative_to(tmp_path / "out" / kind)) for file in files] == [
            "chunk-000/file-000.parquet",
            "chunk-000/file-001.parquet",
            "chunk-001/file-000.parquet",
        ]
        # Each file has the episode that is said to be there.
        for number, file in enumerate(files):
            table = pq.read_table(file)
            assert set(table["episode_index"].to_pylist()) == {number}
            if kind == "meta/episodes":
                for of in ("data", kind):
                    place = (
                        table[f"{of}/chunk_index"][0].as_py(),
                        table[f"{of}/file_index"][0].as_py(),
                    )
                    assert place == divmod(number, 2)


def test_minari_reads_what_was_written(data: TrajectoryData, tmp_path: Path) -> None:
    """By the rules of Minari 0.5, and with HDF5's own reader."""
    h5py = pytest.importorskip("h5py", reason="the extra data is not installed")
    out = tmp_path / "made-up-v0"
    export_data(data, out, "minari")
    content = json.loads((out / "data/metadata.json").read_text("utf-8"))
    assert (content["total_episodes"], content["total_steps"]) == (3, 11)
    spaces = json.loads(content["observation_space"])["subspaces"]
    with h5py.File(out / "data/main_data.hdf5") as file:
        for number, (name, _, frames, _) in enumerate(SONGS):
            group, played = file[f"episode_{number}"], data.columns(number, COLUMNS)
            assert (group.attrs["id"], group.attrs["total_steps"]) == (number, frames - 1)
            assert group.attrs["name"] == name
            for key, array in group["observations"].items():
                assert array.shape == (frames, *spaces[key]["shape"])
            assert set(group["observations"]) == set(spaces)
            np.testing.assert_array_equal(group["observations/joints"], played["joints"])
            np.testing.assert_array_equal(group["actions"], played["action"][:-1])
            hits = (played["goal"] & played["pressed"]).sum(1)
            f1 = 2 * hits / (played["goal"].sum(1) + played["pressed"].sum(1))
            np.testing.assert_allclose(group["rewards"], f1[:-1])
            assert np.flatnonzero(group["truncations"]).tolist() == [frames - 2]
            assert not np.any(group["terminations"])


@pytest.mark.parametrize("data_format", ["lerobot", "minari"])
def test_only_exports_are_replaced(
    data: TrajectoryData, path: Path, tmp_path: Path, data_format: DataFormat
) -> None:
    pytest.importorskip("pyarrow", reason="the extra data is not installed")
    pytest.importorskip("h5py", reason="the extra data is not installed")
    out = tmp_path / "out-v0"
    export_data(data, out, data_format)
    (out / "of-before").touch()
    main(["export-data", str(path), "-o", str(out), "--format", data_format])
    assert not (out / "of-before").exists()
    mark = json.loads((out / MARK).read_text("utf-8"))
    assert mark["numbers"]["action"][-1].endswith("[m]")
    assert [each.name for each in tmp_path.iterdir()] == ["out-v0"]


def test_an_export_within_the_data_set_is_refused(
    data: TrajectoryData, path: Path, tmp_path: Path
) -> None:
    (tmp_path / "link").symlink_to(path)
    for place in (path / "export", tmp_path / "link" / "export"):
        with pytest.raises(InputError, match="is in the data set itself"):
            export_data(data, place, "lerobot")
    assert not (path / "export").exists()


@pytest.mark.parametrize("data_format", ["lerobot", "minari"])
def test_what_fails_leaves_the_older_export(
    data: TrajectoryData, tmp_path: Path, data_format: DataFormat
) -> None:
    pytest.importorskip("pyarrow", reason="the extra data is not installed")
    pytest.importorskip("h5py", reason="the extra data is not installed")
    out = tmp_path / "out-v0"
    export_data(data, out, data_format)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    # The last episode alone is damaged, when two are written.
    damaged = dataclasses.replace(data, episodes=[*data.episodes[:-1], {**data.episodes[-1]}])
    damaged.episodes[-1]["digests"] = dict.fromkeys(COLUMNS, "another")
    with pytest.raises(InputError, match="was changed"):
        export_data(damaged, out, data_format)
    assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["NOTHING", "-o", "out"], "not a data set of trajectories"),
        (["DATA", "-o", "DATA"], "something else than an export"),
        (["DATA", "-o", "mine"], "something else than an export"),
        (["DATA", "-o", "mine/file/out"], "is a file"),
        (["DATA", "-o", "out", "--format", "minari"], "such as expert-v0"),
        (["DAMAGED", "-o", "out"], "damaged"),
    ],
)
def test_bad_input_is_told_in_one_line(
    path: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    pytest.importorskip("pyarrow", reason="the extra data is not installed")
    pytest.importorskip("h5py", reason="the extra data is not installed")
    monkeypatch.chdir(tmp_path)
    write_trajectories(Path("DAMAGED"), made_up_episodes())
    shutil.rmtree("DAMAGED/action/c")
    Path("mine").mkdir()
    Path("mine/file").write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(SystemExit) as stopped:
        main(["export-data", *(str(path) if each == "DATA" else each for each in arguments)])
    assert stopped.value.code == 2
    told = capsys.readouterr().err
    assert message in told
    assert len(told.strip().splitlines()) == 1
    assert sorted(tmp_path.rglob("*")) == before
