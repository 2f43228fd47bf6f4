"""The expert data set: what is written is what was played."""

from __future__ import annotations

import dataclasses
import os
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import zarr

from pianomime.commands.collect import Collect
from pianomime.commands.needs import need_data_sets
from pianomime.errors import InputError
from pianomime.learn.data import episode as episode_module
from pianomime.learn.data.dataset import trajectory_dataset
from pianomime.learn.data.episode import COLUMNS, EVENTS, Column, Episode, Source
from pianomime.learn.data.format import VERSION
from pianomime.learn.data.published import published_episodes, world_order
from pianomime.learn.data.trajectories import TrajectoryData, write_trajectories
from pianomime.learn.expert.config import ExpertConfig
from pianomime.learn.expert.expert import load_expert, train_expert
from pianomime.learn.expert.expert_run import ExpertRun, find_expert_runs
from pianomime.plan.demonstration import Demonstration
from pianomime.sealed_json import sealed
from pianomime.world import World
from pianomime.world.parameters import key_travel
from pianomime.world_names import WORLDS


@pytest.fixture
def runs(
    two_notes: Demonstration, tmp_path: Path, small_ppo: ExpertConfig, small_search: ExpertConfig
) -> Path:
    """A run of each method in one folder, and one that was not begun."""
    dataclasses.replace(two_notes, song_id=42, split="test").save(tmp_path / "demo.npz")
    for name, config in (("a", small_ppo), ("b", small_search)):
        short = dataclasses.replace(config, total_steps=128)
        train_expert(tmp_path / "demo.npz", tmp_path / "runs" / name, short, threads=1)
    return tmp_path / "runs"


def test_episodes_are_what_the_experts_play(runs: Path, tmp_path: Path) -> None:
    out = tmp_path / "experts.zarr"
    Collect((runs,), out).run()
    data = TrajectoryData.open(out)
    assert len(data) == 2
    for number, folder in enumerate(find_expert_runs(runs)):
        player, run = load_expert(folder)
        performance = player.play(run.demonstration.score)
        episode = data.episode(number)
        columns = episode.columns
        assert episode.f1 == pytest.approx(performance.metrics()["f1"])
        np.testing.assert_array_equal(columns["pressed"], performance.pressed)
        np.testing.assert_allclose(columns["action"], performance.ctrl[:, 0], atol=1e-6)
        np.testing.assert_allclose(
            columns["base_control"] + columns["residual"], columns["action"], atol=1e-6
        )
        np.testing.assert_allclose(columns["joints"][1:], performance.qpos[:-1, 88:], atol=1e-6)
        np.testing.assert_allclose(columns["keys"][1:], performance.key_state[:-1], atol=1e-6)
        np.testing.assert_array_equal(columns["goal"], run.demonstration.score.roll())
        assert (episode.song_id, episode.split) == (42, "test")


def test_experts_that_broke_the_physics_are_left_out_with_a_word(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    play, played = episode_module.play_episode, []

    def broken(run: ExpertRun) -> Episode:
        played.append(run)
        if len(played) == 1:
            raise episode_module.PhysicsError("the physics broke in 1 of 30 frames")
        return play(run)

    monkeypatch.setattr(episode_module, "play_episode", broken)
    with pytest.warns(UserWarning, match="left out: .*a: the physics broke in 1 of 30 frames"):
        Collect((runs,), tmp_path / "experts.zarr").run()
    assert len(played) == 2
    assert len(TrajectoryData.open(tmp_path / "experts.zarr")) == 1


def test_it_reads_in_a_few_lines(runs: Path, tmp_path: Path) -> None:
    out = tmp_path / "experts.zarr"
    Collect((runs / "a", runs / "b"), out).run()
    data = zarr.open_group(str(out), mode="r")
    assert data.metadata.zarr_format == 3
    ends = data["episode_end"][:]
    lengths = [len(data["joints"][first:end]) for first, end in zip([0, *ends], ends, strict=False)]
    assert lengths == np.diff(ends, prepend=0).tolist()
    for name, column in COLUMNS.items():
        assert data[name].shape == (ends[-1], *column.shape)
        assert data[name].attrs["description"] == column.description
    # A data set is replaced; anything else is not.
    Collect((runs / "a",), out).run()
    assert len(TrajectoryData.open(out)) == 1
    with pytest.raises(InputError, match="something else than a data set"):
        Collect((runs,), runs).run()


def test_what_fails_leaves_the_older_data(
    runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "experts.zarr"
    Collect((runs,), out).run()
    (runs / "b" / "result.safetensors").write_bytes(b"cut")
    with pytest.raises(InputError, match="damaged"):
        Collect((runs,), out).run()
    assert len(TrajectoryData.open(out)) == 2
    with pytest.raises(InputError, match="no episodes"):
        write_trajectories(out, iter(()))
    replace = os.replace

    def fails(source: str | Path, target: str | Path) -> None:
        # The fresh data set has its name already; the older one was moved aside.
        if Path(target) == out and Path(source).name == out.name:
            raise OSError("cannot be moved")
        replace(source, target)

    episode = TrajectoryData.open(out).episode(0)
    with monkeypatch.context() as patch:
        patch.setattr("pianomime.files.os.replace", fails)
        with pytest.raises(OSError, match="cannot be moved"):
            write_trajectories(out, iter([episode]))
    assert len(TrajectoryData.open(out)) == 2


@pytest.mark.parametrize(
    ("runs", "message"),
    [
        ((), "no runs"),
        ((Path("nowhere"),), "does not exist; .*train-expert"),
        ((Path("x.npz"),), "--demonstrations"),
    ],
)
def test_bad_input(runs: tuple[Path, ...], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        Collect(runs, tmp_path / "experts.zarr").run()


def published(folder: Path, joints: np.ndarray, ctrl: np.ndarray, keys: np.ndarray) -> None:
    """Files of the published shape, of one clip among others."""
    frames = len(joints)
    np.savez(
        folder / "experts.npz",
        clip_id=[7],
        length=[frames],
        qpos_1e4=np.rint(joints * 1e4).astype(np.int16),
        qvel_500=np.zeros((frames, 54), np.int16),
        key_state_255=np.rint(keys * 255).astype(np.uint8),
        ctrl_1e4=np.rint(ctrl * 1e4).astype(np.int16),
    )
    goal = np.zeros((frames + 5, 88), bool)
    goal[5:, 40] = True
    np.savez(
        folder / "demonstrations.npz",
        clip_id=[3, 7],
        length=[5, frames],
        fingertips=np.arange((frames + 5) * 36.0).reshape(-1, 2, 6, 3).astype(np.float32) / 1e4,
        finger_key=np.full((frames + 5, 2, 5), -1, np.int8),
        goal_packed=np.packbits(goal, axis=1),
    )


def test_published_experts_come_into_the_same_form(tmp_path: Path) -> None:
    draw = np.random.default_rng(0)
    joints, ctrl = draw.uniform(0, 0.1, (6, 54)), draw.uniform(-1, 1, (6, 46))
    keys = np.zeros((6, 88))
    keys[3:5, 40] = 1.0
    published(tmp_path, joints, ctrl, keys)
    out = tmp_path / "experts.zarr"
    Collect((tmp_path / "experts.npz",), out, tmp_path / "demonstrations.npz").run()
    episode = TrajectoryData.open(out).episode(0)
    assert (episode.name, episode.song_id, episode.split) == ("clip007", -1, "train")
    with np.load(tmp_path / "demonstrations.npz") as file:
        marks = {"song_group": [4, 9], "split": ["train", "train"], "odd": [False, True]}
        np.savez(tmp_path / "marked.npz", **file, **marks)
    marked, _ = next(published_episodes(tmp_path / "experts.npz", tmp_path / "marked.npz"))
    assert (marked.song_id, marked.split) == (9, "odd")
    columns = episode.columns
    # A row's keys are answered by the next row's; goal and tips are those of its own clip.
    np.testing.assert_array_equal(columns["pressed"][:, 40], [0, 0, 1, 1, 0, 0])
    assert columns["goal"][:, 40].all()
    assert columns["fingertips"][0, 0, 0, 0] == pytest.approx(5 * 36 / 1e4)
    # Left came first, with the forearm last.
    model = World().model
    assert columns["joints"][0, 0] == pytest.approx(joints[0, 27 + 24], abs=1e-4)
    assert columns["joints"][0, 27 + 3] == pytest.approx(joints[0, 0], abs=1e-4)
    assert model.joint(88).name == "rh_forearm_tx"
    assert model.joint(88 + 27 + 3).name == "lh_WRJ2"


def test_a_damaged_data_set_is_one_line(two_notes: Demonstration, tmp_path: Path) -> None:
    columns = {name: np.ones((4, *column.shape), column.dtype) for name, column in COLUMNS.items()}
    out = tmp_path / "experts.zarr"
    write_trajectories(out, iter([Episode("one", 0.0, "ik", columns)]))
    chunk = next(file for file in (out / "joints" / "c").rglob("*") if file.is_file())
    chunk.write_bytes(chunk.read_bytes()[: chunk.stat().st_size // 2])
    with pytest.raises(InputError, match="damaged"):
        TrajectoryData.open(out).episode(0)
    zarr.open_group(str(out)).attrs["episodes"] = [{"name": "one"}]
    with pytest.raises(InputError, match="damaged"):
        TrajectoryData.open(out)
    for ends in (np.zeros(0, int), np.array([[4]]), np.array([np.nan]), np.array([4, 4])):
        zarr.open_group(str(out)).create_array("episode_end", data=ends, overwrite=True)
        with pytest.raises(InputError, match="damaged"):
            TrajectoryData.open(out)
    for file, text in (("goal/zarr.json", '{"zarr'), ("zarr.json", "[]")):
        (out / file).write_text(text)
        with pytest.raises(InputError, match=r"damaged|not a data set"):
            TrajectoryData.open(out)


def test_damage_names_the_path_as_it_was_given_and_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    out = Path("d2.zarr")
    write_trajectories(out, iter([random_episode(4, 50, 0)]))
    data = TrajectoryData.open(out)
    (out / "event_key" / "c" / "0").unlink()
    with pytest.raises(
        InputError, match=r"^d2\.zarr: damaged \(event_key of episode 0 was changed"
    ):
        data.episode(0)
    (out / "event_time" / "zarr.json").unlink()
    with pytest.raises(
        InputError, match=r"^d2\.zarr: damaged \(the array event_time is missing\)$"
    ):
        TrajectoryData.open(out)
    text = (out / "zarr.json").read_text()
    (out / "zarr.json").write_text(text[: len(text) // 2])
    damaged = r"^d2\.zarr: damaged \(zarr\.json: it is not JSON\)"
    with pytest.raises(InputError, match=damaged):
        TrajectoryData.open(out)
    with pytest.raises(InputError, match=f"{damaged}; `pianomime"):
        need_data_sets([out])


@pytest.mark.parametrize("how", ["gone", "swapped", "flipped", "f1", "chunk shape", "a day"])
def test_what_a_data_set_does_not_show_is_found(tmp_path: Path, how: str) -> None:
    columns = {
        name: np.ones((5000, *column.shape), column.dtype) for name, column in COLUMNS.items()
    }
    columns["keys"][4096:] = 0.5
    columns["keys"][:7] = 0.0
    out = tmp_path / "experts.zarr"
    write_trajectories(out, iter([Episode("one", 0.25, "ik", columns)]))
    first, second = out / "keys" / "c" / "0" / "0", out / "keys" / "c" / "1" / "0"
    group, keys = out / "zarr.json", out / "keys" / "zarr.json"
    if how == "gone":
        second.unlink()
    elif how == "swapped":
        second.write_bytes(first.read_bytes())
    elif how == "flipped":
        first.write_bytes(first.read_bytes()[:-9] + b"x" + first.read_bytes()[-8:])
    elif how == "f1":
        group.write_text(group.read_text().replace("0.25", "0.95"))
    elif how == "chunk shape":
        keys.write_text(keys.read_text().replace("4096", "0"))
    else:
        keys.write_text(keys.read_text().replace("5000", "5000000000000"))
        group.write_text(group.read_text().replace("5000", "5000000000000"))
    with pytest.raises(InputError, match="damaged") as caught:
        TrajectoryData.open(out).episode(0)
    assert "\n" not in str(caught.value)


def test_published_files_of_another_shape(tmp_path: Path) -> None:
    published(tmp_path, np.zeros((6, 54)), np.zeros((6, 46)), np.zeros((6, 88)))
    np.savez(tmp_path / "other.npz", length=[3])
    with pytest.raises(InputError, match="clip_id"):
        next(published_episodes(tmp_path / "experts.npz", tmp_path / "other.npz"))
    with np.load(tmp_path / "demonstrations.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "longer.npz", **{**arrays, "length": [4, 7]})
    with pytest.raises(InputError, match="clip 7 is not as long"):
        next(published_episodes(tmp_path / "experts.npz", tmp_path / "longer.npz"))
    np.savez(tmp_path / "odd.npz", **{**arrays, "length": [11]})
    with pytest.raises(InputError, match="length must have"):
        next(published_episodes(tmp_path / "experts.npz", tmp_path / "odd.npz"))
    with pytest.raises(InputError, match="does not exist"):
        next(published_episodes(tmp_path / "none.npz", tmp_path / "other.npz"))


def test_published_base_controls_are_near_the_recorded_actions(shared: Path) -> None:
    folder = shared / "data" / "pianomime"
    read = published_episodes(folder / "experts.npz", folder / "demonstrations.npz")
    episode, total = next(read)
    assert total == 211
    low, high = World().model.actuator_ctrlrange.T
    share = np.abs(episode.columns["residual"]) / (high - low)
    assert (share < 1.05 * 0.03).all(axis=1).mean() > 0.97
    assert 0.8 < episode.f1 <= 1.0
    keys = episode.columns["keys"] * key_travel()
    assert keys.shape[1] == 88
    assert world_order(np.arange(54.0)[None])[0, :3].tolist() == [51.0, 52.0, 53.0]


def test_a_data_set_of_an_older_version_is_one_line(tmp_path: Path) -> None:
    columns = {name: np.ones((4, *column.shape), column.dtype) for name, column in COLUMNS.items()}
    out = tmp_path / "experts.zarr"
    write_trajectories(out, iter([Episode("one", 0.0, "ik", columns)]))
    zarr.open_group(str(out)).attrs["version"] = VERSION - 1
    with pytest.raises(InputError, match="collect it again") as error:
        TrajectoryData.open(out)
    assert "\n" not in str(error.value)
    # Which can be done, in the same place; and so it is with one that is damaged.
    write_trajectories(out, iter([Episode("one", 0.0, "ik", columns)]))
    assert len(TrajectoryData.open(out)) == 1
    (out / "goal" / "zarr.json").write_text("[")
    write_trajectories(out, iter([Episode("one", 0.0, "ik", columns)]))
    assert len(TrajectoryData.open(out)) == 1
    (tmp_path / "notes").mkdir()
    with pytest.raises(InputError, match="something else"):
        write_trajectories(tmp_path / "notes", iter([Episode("one", 0.0, "ik", columns)]))


def filled(name: str, world: str, song: int = -1) -> Episode:
    columns = {each: np.ones((4, *one.shape), one.dtype) for each, one in COLUMNS.items()}
    return Episode(name, 0.0, "ik", columns, song, "train", world)


def test_a_data_set_names_the_world(
    two_notes: Demonstration, tmp_path: Path, small_search: ExpertConfig
) -> None:
    two_notes.save(tmp_path / "demo.npz")
    for world in WORLDS:
        env = dataclasses.replace(small_search.env, world=world)
        short = dataclasses.replace(small_search, total_steps=128, env=env)
        train_expert(tmp_path / "demo.npz", tmp_path / "runs" / world, short, threads=1)
        out = tmp_path / f"{world}.zarr"
        Collect((tmp_path / "runs" / world,), out).run()
        assert TrajectoryData.open(out).episode(0).world == world
    with pytest.raises(InputError, match="a data set is of one world"):
        Collect((tmp_path / "runs",), tmp_path / "experts.zarr").run()


def test_a_data_set_that_names_no_world_is_of_the_papers(tmp_path: Path) -> None:
    out = tmp_path / "experts.zarr"
    write_trajectories(out, iter([filled("one", "paper")]))
    group = zarr.open_group(str(out))
    content = {name: value for name, value in group.attrs.asdict().items() if name != "digest"}
    for episode in content["episodes"]:
        del episode["world"]
    group.attrs.put(sealed(content))
    assert TrajectoryData.open(out).episode(0).world == "paper"


def test_episodes_of_different_worlds_are_refused_in_one_line(tmp_path: Path) -> None:
    mixed = iter([filled("one", "paper"), filled("two", "solid")])
    with pytest.raises(InputError, match=r"two .* world solid, one in paper") as error:
        write_trajectories(tmp_path / "mixed.zarr", mixed)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "mixed.zarr").exists()
    sources = []
    for song, world in enumerate(WORLDS):
        sources.append(tmp_path / f"{world}.zarr")
        write_trajectories(sources[-1], iter([filled(world, world, song)]))
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            assert len(trajectory_dataset(sources[-1:])) == 1
        assert [str(one.message) for one in told] == [
            f"{sources[-1]}: played in the world {world}; "
            f"play what learns from it with --world {world}"
        ] * (world != "paper")
    with pytest.raises(InputError, match="a data set is of one world") as error:
        trajectory_dataset(sources)
    assert "\n" not in str(error.value)


def random_episode(frames: int, events: int, seed: int) -> Episode:
    rng = np.random.default_rng(seed)

    def drawn(columns: Mapping[str, Column], rows: int) -> dict[str, np.ndarray]:
        return {
            name: rng.integers(0, 2, (rows, *column.shape)).astype(column.dtype)
            for name, column in columns.items()
        }

    source = Source("song", "0" * 64, "somebody", 0, seed, "0.1")
    columns, noted = drawn(COLUMNS, frames), drawn(EVENTS, events)
    return Episode(f"{seed}", 0.5, "ik", columns, seed, "train", "paper", noted, source)


def test_episodes_across_chunks_come_back_as_they_were(tmp_path: Path) -> None:
    out = tmp_path / "experts.zarr"
    # A chunk has 4096 rows: one within, one that fills it, one of several, a silent one.
    sizes = [(3000, 5), (1096, 0), (9000, 4100), (1, 0)]
    written = [random_episode(*size, seed) for seed, size in enumerate(sizes)]
    write_trajectories(out, iter(written))
    data = TrajectoryData.open(out)
    assert np.diff(data.ends, prepend=0).tolist() == [size for size, _ in sizes]
    assert np.diff(data.event_ends, prepend=0).tolist() == [size for _, size in sizes]
    for number, one in enumerate(written):
        read = data.episode(number)
        assert (read.name, read.song_id, read.source) == (one.name, one.song_id, one.source)
        for there, wanted in ((read.columns, one.columns), (read.events, one.events)):
            assert list(there) == list(wanted)
            for name, array in wanted.items():
                np.testing.assert_array_equal(there[name], array)


@pytest.mark.parametrize("how", ["gone", "cut", "ends", "source"])
def test_damage_of_events_and_sources_is_one_line(tmp_path: Path, how: str) -> None:
    out = tmp_path / "experts.zarr"
    write_trajectories(out, iter([random_episode(4, 50, 0)]))
    chunk = out / "event_key" / "c" / "0"
    if how == "gone":
        chunk.unlink()
    elif how == "cut":
        chunk.write_bytes(chunk.read_bytes()[: chunk.stat().st_size // 2])
    elif how == "ends":
        zarr.open_group(str(out)).create_array("event_end", data=np.array([49]), overwrite=True)
    else:
        content = zarr.open_group(str(out)).attrs.asdict()
        del content["digest"], content["episodes"][0]["source"]["player"]
        zarr.open_group(str(out)).attrs.put(sealed(content))
    with pytest.raises(InputError, match="damaged") as caught:
        TrajectoryData.open(out).episode(0)
    assert "\n" not in str(caught.value)


class Killed(BaseException):
    """What ends a process at once."""


@pytest.mark.parametrize("moment", ["between", "after"])
def test_killed_while_one_replaces_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    columns = {name: np.ones((4, *column.shape), column.dtype) for name, column in COLUMNS.items()}
    out = tmp_path / "experts.zarr"
    write_trajectories(out, iter([Episode("old", 0.0, "ik", columns)]))
    replace = os.replace

    def killed(source: str | Path, target: str | Path) -> None:
        if moment == "after" or Path(target) != out:
            replace(source, target)
        if Path(target) == out:
            raise Killed

    with monkeypatch.context() as patch:
        patch.setattr("pianomime.files.os.replace", killed)
        # A killed process puts nothing back.
        patch.setattr("pianomime.files._undo", lambda older, path: None)
        with pytest.raises(Killed):
            write_trajectories(out, iter([Episode("new", 0.0, "ik", columns)]))
    assert out.exists() == (moment == "after")
    # The next run sweeps, and comes to nothing: one of both is there, whole, and nothing else.
    with pytest.raises(InputError, match="no episodes"):
        write_trajectories(out, iter(()))
    name = "new" if moment == "after" else "old"
    assert TrajectoryData.open(out).episode(0).name == name
    assert [each.name for each in tmp_path.iterdir()] == [out.name]


def test_more_episodes_than_a_data_set_can_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    columns = {name: np.ones((4, *column.shape), column.dtype) for name, column in COLUMNS.items()}
    monkeypatch.setattr("pianomime.learn.data.trajectories.MOST_BYTES", 2000)
    with pytest.raises(InputError, match="2 episodes are too many"):
        write_trajectories(
            tmp_path / "many.zarr", iter([Episode(name, 0.0, "ik", columns) for name in "ab"])
        )
    assert not (tmp_path / "many.zarr").exists()


@pytest.mark.parametrize("name", ["qpos_1e4", "qvel_500", "ctrl_1e4"])
@pytest.mark.parametrize("value", [1e20, 1e300, -1e20])
def test_published_numbers_out_of_range(tmp_path: Path, name: str, value: float) -> None:
    published(tmp_path, np.zeros((6, 54)), np.zeros((6, 46)), np.zeros((6, 88)))
    with np.load(tmp_path / "experts.npz") as file:
        arrays = dict(file)
    arrays[name] = np.full(arrays[name].shape, value)
    np.savez(tmp_path / "experts.npz", **arrays)
    with pytest.raises(InputError, match=name):
        next(published_episodes(tmp_path / "experts.npz", tmp_path / "demonstrations.npz"))
