from __future__ import annotations

import contextlib
import shutil

import numpy as np
import pytest

import made_up_video as made_up
from pianomime import cli
from pianomime.errors import InputError
from pianomime.keyboard import NO_KEY
from pianomime.learn.data import published
from pianomime.learn.data.published import demonstration_of, read_published
from pianomime.plan.demonstration import Demonstration
from pianomime.world.parameters import key_centres


@pytest.fixture(scope="module")
def clip():
    """Fingertips and goals as PianoMime makes them."""
    score = made_up.song(4.0)
    plan = made_up.plan_of(score)
    tips = plan.fingertips.copy()
    tips[..., 2] = 0.045
    frame, hand, finger = np.nonzero(plan.finger_key >= 0)
    key = plan.finger_key[frame, hand, finger]
    tips[frame, hand, finger + 1, 1] = key_centres()[key, 1]
    tips[frame, hand, finger + 1, 2] = 0.0
    return tips, plan.keys(), plan.finger_key


def test_a_clean_clip_comes_through(clip):
    tips, goal, finger_key = clip
    made = demonstration_of(tips, goal, "a", "data")
    np.testing.assert_array_equal(made.score.roll()[: len(goal)], goal)
    np.testing.assert_array_equal(made.plan.finger_key[: len(goal)], finger_key)
    np.testing.assert_allclose(made.plan.fingertips[: len(goal)], tips, atol=1e-9)
    assert made.quality["points_mended"] == made.quality["stale_presses"] == 0


def test_faults_are_repaired(clip):
    tips, goal, finger_key = clip
    faulty = tips.copy()
    idle = np.flatnonzero((finger_key[:, 0] == NO_KEY).all(axis=1))[0]
    faulty[idle, 0, 2] = [0.0, key_centres()[70, 1], 0.0]  # a press that is left over
    faulty[10:13, 1, 0] = [0.19, 0.15, 0.12]  # the robot's rest pose
    made = demonstration_of(faulty, goal, "a", "data")
    assert not made.plan.keys()[:, 70].any()
    assert made.quality["stale_presses"] == 1
    assert made.quality["points_mended"] == 3
    np.testing.assert_allclose(made.plan.fingertips[10:13, 1, 0], tips[10:13, 1, 0], atol=0.02)
    assert (made.plan.fingertips[..., 2] < 0.1).all()


def test_the_command(clip, tmp_path):
    tips, goal, _ = clip
    source = tmp_path / "clips.npz"
    np.savez(
        source,
        fingertips=np.concatenate((tips, tips)),
        goal_packed=np.packbits(np.concatenate((goal, goal)), axis=1),
        length=np.array([len(tips), len(tips)]),
    )
    cli.main(["import-demos", str(source), "-o", str(tmp_path / "demos")])
    files = sorted((tmp_path / "demos").iterdir())
    assert [file.name for file in files] == ["clips-000.npz", "clips-001.npz"]
    assert Demonstration.load(files[1]).score.title == "clips-001"
    assert Demonstration.load(files[1]).split == "train"


@pytest.fixture
def four_clips(clip, tmp_path):
    """Two for training, of one song; one of a test; and one of which nothing can be learned."""
    tips, goal, _ = clip
    source = tmp_path / "clips.npz"
    np.savez(
        source,
        fingertips=np.concatenate([tips] * 4),
        goal_packed=np.packbits(np.concatenate([goal] * 4), axis=1),
        length=np.full(4, len(tips)),
        song_group=np.array([3, 3, 5, 8]),
        split=np.array(["train", "train", "test", "train"]),
        odd=np.array([False, False, False, True]),
    )
    return source


def test_what_is_not_for_training_is_left_out_of_it(four_clips, tmp_path):
    pytest.importorskip("zarr")
    from pianomime.learn.data.dataset import read_demonstrations

    cli.main(["import-demos", str(four_clips), "-o", str(tmp_path / "demos")])
    made = [Demonstration.load(file) for file in sorted((tmp_path / "demos").iterdir())]
    assert [(one.song_id, one.split) for one in made] == [
        (3, "train"),
        (3, "train"),
        (5, "test"),
        (8, "odd"),
    ]
    for source in (four_clips, tmp_path / "demos"):
        titles = [one.score.title for one in read_demonstrations(source)]
        assert titles == ["clips-000", "clips-001"]


def test_what_is_no_demonstration_of_a_folder_is_not_read(four_clips, tmp_path, capsys):
    """What a killed process or macOS left; of clips of another import a line tells."""
    pytest.importorskip("zarr")
    from pianomime.learn.data.dataset import read_demonstrations

    demos = tmp_path / "demos"
    cli.main(["import-demos", str(four_clips), "-o", str(demos)])
    left = demos / ".pianomime-0123456789abcdef" / "out"
    left.mkdir(parents=True)
    one = (demos / "clips-000.npz").read_bytes()
    (left / "clips-000.npz").write_bytes(one)
    (demos / "._clips-000.npz").write_bytes(b"of a Mac")
    assert len(read_demonstrations(demos)) == 2
    capsys.readouterr()
    cli.main(["import-demos", str(four_clips), "-o", str(demos), "--clips", "1"])
    assert "holds 3 more .npz files of before" in capsys.readouterr().err


@pytest.mark.parametrize(
    "change",
    [
        {"song_group": np.array([1.5, 1, 1, 1])},
        {"split": np.array(["train"])},
        {"odd": np.array([0, 1, 0, 1])},
    ],
)
def test_odd_marks_are_refused(four_clips, tmp_path, change):
    with np.load(four_clips) as file:
        arrays = {name: file[name] for name in file.files}
    np.savez(tmp_path / "other.npz", **(arrays | change))
    with pytest.raises(InputError, match=r"song_group|split|odd"):
        list(read_published(tmp_path / "other.npz"))


@pytest.fixture
def data_set(clip, tmp_path):
    """As PianoMime publishes it: zarr 2, Blosc with LZ4, four frames a row, inclusive ends."""
    zarr = pytest.importorskip("zarr")
    numcodecs = pytest.importorskip("numcodecs")
    tips, _, finger_key = clip
    frames = np.hstack((tips.reshape(len(tips), -1), (finger_key.reshape(-1, 10) + 1) / 89))
    following = np.minimum(np.arange(len(tips))[:, None] + np.arange(4), len(tips) - 1)
    action = frames[following].reshape(len(tips), -1).astype(np.float32)
    short = action[:50]
    folder = tmp_path / "high-level.zarr"
    root = zarr.open_group(str(folder), mode="w", zarr_format=2)
    for name, array in (
        ("data/action", np.vstack((action, short))),
        ("data/state", np.zeros((len(action) + 50, 212), np.float32)),
        ("meta/episode_ends", np.array([len(action) - 1, len(action) + 49], np.float32)),
    ):
        root.create_array(
            name, data=array, chunks=(30, *array.shape[1:]), compressors=numcodecs.Blosc("lz4")
        )
    return folder


def test_the_published_data_set(clip, data_set, tmp_path):
    tips, goal, finger_key = clip
    cli.main(["import-demos", str(data_set), "-o", str(tmp_path / "demos")])
    files = sorted((tmp_path / "demos").iterdir())
    assert [file.name for file in files] == ["high-level-000.npz", "high-level-001.npz"]
    first, second = map(Demonstration.load, files)
    np.testing.assert_array_equal(first.score.roll()[: len(goal)], goal)
    np.testing.assert_array_equal(first.plan.finger_key[: len(goal)], finger_key)
    np.testing.assert_allclose(first.plan.fingertips[: len(goal)], tips, atol=1e-6)
    np.testing.assert_array_equal(second.score.roll()[:50], goal[:50])


def test_other_zarr_folders(data_set, tmp_path):
    zarr = pytest.importorskip("zarr")
    low_level = tmp_path / "low-level.zarr"
    root = zarr.open_group(str(low_level), mode="w", zarr_format=2)
    for name, width in (("state", 404), ("action", 46)):
        root.create_array(name, data=np.zeros((8, width), np.float32))
    root.create_array("episode_ends", data=np.array([7.0]))
    array = tmp_path / "array.zarr"
    zarr.save_array(str(array), np.zeros(5))
    gone = tmp_path / "gone.zarr"
    shutil.copytree(data_set, gone)
    (gone / "data" / "action" / "1.0").unlink()
    (data_set / "data" / "action" / "0.0").write_bytes(b"damaged")
    for folder in (low_level, array, data_set, gone):
        with pytest.raises(InputError, match="not PianoMime's high-level data set") as told:
            list(read_published(folder))
        assert "\n" not in str(told.value)


def test_what_is_no_data(tmp_path):
    empty = tmp_path / "empty.npz"
    np.savez(empty, a=1)
    wrong = tmp_path / "wrong.npz"
    np.savez(wrong, fingertips=np.zeros((5, 2, 6, 3)), length=np.array([9]))
    for path in (empty, wrong, tmp_path / "nowhere.npz", tmp_path):
        with pytest.raises((InputError, OSError)):
            list(read_published(path))


def test_damaged_and_odd_arrays(clip, tmp_path):
    tips, goal, _ = clip
    path = tmp_path / "odd.npz"
    for odd in (
        {"goal_packed": np.zeros(len(tips), np.uint8)},
        {"goal_packed": goal},
        {"length": np.array([-1, len(tips) + 1])},
        {"fingertips": np.zeros(())},
        {"fingertips": tips.astype(str)},
    ):
        np.savez(path, **({"fingertips": tips} | odd))
        with pytest.raises(InputError):
            list(read_published(path))
    np.savez_compressed(path, fingertips=tips, goal=goal)
    whole = path.read_bytes()
    for at in range(60, len(whole), len(whole) // 40):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        with contextlib.suppress(InputError):  # or it did no harm
            list(read_published(path))


def test_a_hand_that_was_never_seen(clip):
    tips, goal, _ = clip
    half = tips.copy()
    half[:, 0] = np.nan
    made = demonstration_of(half, goal, "a", "data")
    assert np.isfinite(made.plan.fingertips).all()
    assert (made.plan.finger_key[:, 0] == NO_KEY).all()


def test_all_clips_or_none(clip, tmp_path, monkeypatch):
    tips, _, _ = clip
    source, out = tmp_path / "clips.npz", tmp_path / "demos"
    np.savez(source, fingertips=np.concatenate((tips, tips)), length=np.array([len(tips)] * 2))
    with pytest.raises(SystemExit) as stopped:
        cli.main(["import-demos", str(source), "--clips", "-1", "-o", str(out)])
    assert stopped.value.code == 2

    def interrupted(*given, **named):
        made = demonstration_of(*given, **named)
        if made.score.title.endswith("001"):
            raise KeyboardInterrupt
        return made

    monkeypatch.setattr(published, "demonstration_of", interrupted)
    with pytest.raises(SystemExit):
        cli.main(["import-demos", str(source), "-o", str(out)])
    assert not out.exists()


def test_the_published_ones(shared):
    found = list(read_published(shared / "data" / "pianomime" / "demonstrations.npz", 2))
    assert [total for _, total in found] == [2, 2]
    for made, _ in found:
        keys = made.plan.keys() & made.score.roll()
        assert keys.sum() > 0.97 * made.score.roll().sum()
