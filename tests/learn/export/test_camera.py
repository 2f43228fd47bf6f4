"""Pictures in exports for LeRobot: each is of the recorded state of its frame."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from pianomime.cli import main
from pianomime.errors import InputError
from pianomime.learn.data.episode import Episode, empty_columns
from pianomime.learn.data.trajectories import TrajectoryData, write_trajectories
from pianomime.learn.export.data_export import export_data
from pianomime.learn.export.feature_stats import QUANTILES
from pianomime.learn.export.picture_stats import PictureStats
from pianomime.progress import telling
from pianomime.world import render
from pianomime.world.parameters import key_travel
from pianomime.world.render import Painter, RenderUnavailable, View, render_frame
from pianomime.world.scene_look import key_colours

SONGS = (("rise", "train", 5), ("fall", "test", 3), ("rise", "train", 4))
"""Name, split and frames of each episode."""
ORDER = (0, 2, 1)
"""Of the episodes in an export: those for training first."""
FEATURE = "observation.images.top"
VIEW = View("top", (320, 136))


def states() -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Keys (T, 88) and joints (T, 54) of each episode: no two frames are alike."""
    at = 0
    for _, _, frames in SONGS:
        keys, joints = np.zeros((frames, 88), np.float32), np.zeros((frames, 54), np.float32)
        for frame in range(frames):
            keys[frame, 7 * at] = 1.0
            joints[frame, [0, 27]] = 0.3 * np.sin(at)
            at += 1
        yield keys, joints


def episodes() -> Iterator[Episode]:
    for (name, split, frames), (keys, joints) in zip(SONGS, states(), strict=True):
        columns = {each: np.zeros_like(array) for each, array in empty_columns(frames).items()}
        columns["keys"][:], columns["joints"][:] = keys, joints
        yield Episode(name, 0.5, "dynamic", columns, 1, split)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("pyarrow", reason="the extra data is not installed")
    path = tmp_path_factory.mktemp("data") / "made-up.zarr"
    write_trajectories(path, episodes())
    return path


@pytest.fixture(scope="module")
def opengl() -> None:
    try:
        render_frame(np.zeros(142), np.zeros(88, bool), 16, 16)
    except RenderUnavailable as reason:
        pytest.skip(str(reason))


@pytest.fixture(scope="module")
def rendered(opengl: None) -> list[np.ndarray]:
    """The pictures of each episode, as they are rendered."""
    with Painter(*VIEW.size, VIEW.camera, smooth=True) as painter:
        return [
            np.stack(
                [
                    painter.paint(
                        np.concatenate([down * key_travel(), hands]), key_colours(down == 1)
                    )
                    for down, hands in zip(keys, joints, strict=True)
                ]
            )
            for keys, joints in states()
        ]


def read_video(file: Path) -> tuple[list[float], np.ndarray]:
    """Times [s] and pictures (T, height, width, 3)."""
    with av.open(str(file)) as film:
        assert not film.streams.audio
        pictures = list(film.decode(video=0))
    return [each.time for each in pictures], np.stack(
        [p.to_ndarray(format="rgb24") for p in pictures]
    )


def read_rows(out: Path) -> list[dict[str, Any]]:
    """What is said of each episode."""
    import pyarrow.parquet as pq

    files = sorted((out / "meta/episodes").rglob("*.parquet"))
    return [row for file in files for row in pq.read_table(file).to_pylist()]


def test_pictures_show_the_recorded_states(
    path: Path, tmp_path: Path, rendered: list[np.ndarray]
) -> None:
    out = tmp_path / "out"
    main(["export-data", str(path), "-o", str(out), "--camera", "top"])
    info = json.loads((out / "meta/info.json").read_text("utf-8"))
    feature = info["features"][FEATURE]
    assert (feature["dtype"], feature["shape"]) == ("video", [136, 320, 3])
    assert feature["names"] == ["height", "width", "channels"]
    assert info["video_files_size_in_mb"] == 200
    file = info["video_path"].format(video_key=FEATURE, chunk_index=0, file_index=0)
    assert [str(each.relative_to(out)) for each in (out / "videos").rglob("*.mp4")] == [file]
    with av.open(str(out / file)) as film:
        stream = film.streams.video[0]
        said, (height, width, _) = feature["info"], feature["shape"]
        assert (stream.height, stream.width) == (height, width)
        assert (stream.height, stream.width) == (said["video.height"], said["video.width"])
        assert stream.codec.canonical_name == said["video.codec"]
        assert stream.pix_fmt == said["video.pix_fmt"]
        assert stream.base_rate == said["video.fps"] == info["fps"]
        assert not said["video.is_depth_map"]
        assert not said["has_audio"]
    times, pictures = read_video(out / file)
    np.testing.assert_allclose(times, np.arange(12) / 20, atol=1e-9)
    wanted = np.concatenate([rendered[number] for number in ORDER]).astype(int)
    end = 0.0
    for row in read_rows(out):
        assert row[f"videos/{FEATURE}/chunk_index"] == row[f"videos/{FEATURE}/file_index"] == 0
        begin, before = row[f"videos/{FEATURE}/from_timestamp"], end
        assert begin == before
        end = row[f"videos/{FEATURE}/to_timestamp"]
        assert end == pytest.approx(begin + row["length"] / 20)
        # As LeRobot finds the picture of a row: by the time in its episode.
        for frame in range(row["length"]):
            at = int(np.argmin(np.abs(np.array(times) - (begin + frame / 20))))
            apart = [np.abs(each - pictures[at]).mean() for each in wanted]
            own = row["dataset_from_index"] + frame
            assert np.argmin(apart) == own
            assert apart[own] < 4
            assert min(np.delete(apart, own)) > 1.5 * apart[own]
    assert end == pytest.approx(12 / 20)


def test_statistics_are_those_of_the_pictures(
    data: TrajectoryData, tmp_path: Path, rendered: list[np.ndarray]
) -> None:
    export_data(data, tmp_path / "out", "lerobot", VIEW)
    of_all = json.loads((tmp_path / "out/meta/stats.json").read_text("utf-8"))[FEATURE]
    rows = read_rows(tmp_path / "out")
    for number, row in zip(ORDER, rows, strict=True):
        pixels = rendered[number] / 255
        assert row[f"stats/{FEATURE}/count"] == [len(pixels)]
        for stat in ("min", "max", "mean", "std"):
            found = np.array(row[f"stats/{FEATURE}/{stat}"])
            assert found.shape == (3, 1, 1)
            np.testing.assert_allclose(found.ravel(), getattr(pixels, stat)((0, 1, 2)))
    pixels = np.concatenate(rendered) / 255
    assert of_all["count"] == [12]
    for stat in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(np.ravel(of_all[stat]), getattr(pixels, stat)((0, 1, 2)))


def test_statistics_of_random_pictures() -> None:
    random = np.random.default_rng(0)
    pictures = random.integers(3, 200, (6, 8, 10, 3)).astype(np.uint8)
    whole, part = PictureStats(), PictureStats()
    for number, picture in enumerate(pictures):
        (whole if number < 4 else part).add(picture)
    whole += part
    found = whole.of_all()
    pixels = pictures.reshape(-1, 3) / 255
    assert found["count"].tolist() == [6]
    for stat in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(found[stat][:, 0, 0], getattr(pixels, stat)(0))
    for name, share in QUANTILES.items():
        wanted = np.quantile(pixels, share, axis=0, method="inverted_cdf")
        np.testing.assert_allclose(found[name][:, 0, 0], wanted)


@pytest.mark.usefixtures("opengl")
def test_files_are_begun_where_one_is_full(
    data: TrajectoryData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pianomime.learn.export.camera.VIDEO_MIB", 1e-6)
    monkeypatch.setattr("pianomime.learn.export.numbered_files.FILES_IN_CHUNK", 2)
    export_data(data, tmp_path / "out", "lerobot", View("side", (64, 32)))
    feature = "observation.images.side"
    for number, row in enumerate(read_rows(tmp_path / "out")):
        place = {part: row[f"videos/{feature}/{part}"] for part in ("chunk_index", "file_index")}
        assert tuple(place.values()) == divmod(number, 2)
        pattern = json.loads((tmp_path / "out/meta/info.json").read_text("utf-8"))["video_path"]
        times, _ = read_video(tmp_path / "out" / pattern.format(video_key=feature, **place))
        assert len(times) == row["length"]
        assert row[f"videos/{feature}/from_timestamp"] == 0
        assert row[f"videos/{feature}/to_timestamp"] == pytest.approx(len(times) / 20)


@pytest.mark.usefixtures("opengl")
def test_a_camera_changes_nothing_else(data: TrajectoryData, tmp_path: Path) -> None:
    told: list[tuple[Any, ...]] = []
    export_data(data, tmp_path / "blind", "lerobot")
    with telling(lambda *each: told.append(each)):
        export_data(data, tmp_path / "seen", "lerobot", View("player", (32, 16)))
    assert told == [("exporting", done, 12, "") for done in range(13)]
    blind, seen = (
        {file.relative_to(tmp_path / name): file.read_bytes() for file in files if file.is_file()}
        for name in ("blind", "seen")
        for files in [(tmp_path / name).rglob("*")]
    )
    differ = {str(file) for file in seen if seen[file] != blind.get(file)}
    assert differ == {
        "meta/info.json",
        "meta/stats.json",
        "meta/episodes/chunk-000/file-000.parquet",
        "videos/observation.images.player/chunk-000/file-000.mp4",
    }
    assert set(blind) < set(seen)
    assert json.loads(blind[Path("meta/info.json")])["video_path"] is None


@pytest.mark.usefixtures("opengl")
def test_rendering_that_fails_leaves_the_older_export(
    data: TrajectoryData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, view = tmp_path / "out", View("top", (32, 16))
    export_data(data, out, "lerobot", view)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    paint, left = Painter.paint, 0

    def fail(self: Painter, *given: Any) -> np.ndarray:
        nonlocal left
        if not left:
            raise OSError(28, "No space left on device")
        left -= 1
        return paint(self, *given)

    monkeypatch.setattr(Painter, "paint", fail)
    for painted, place in ((0, out), (7, out), (7, tmp_path / "new")):
        left = painted
        with pytest.raises(OSError, match="No space left"):
            export_data(data, place, "lerobot", view)
        assert {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()} == before
        assert [each.name for each in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize(
    ("arguments", "message", "code"),
    [
        (["--camera", "top", "--format", "minari"], "for lerobot alone", 2),
        (["--camera", "nowhere"], "nowhere", 2),
        (["--size", "320", "136"], "which need a --camera", 2),
        (["--camera", "top", "--size", "321", "136"], "even numbers from 16 to 2048", 2),
        (["--camera", "top", "--size", "320", "4000"], "even numbers from 16 to 2048", 2),
        (["--camera", "top"], "install", 1),
    ],
)
def test_what_cannot_be_is_told_in_one_line(
    path: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
    code: int,
) -> None:
    pytest.importorskip("h5py", reason="the extra data is not installed")

    def nothing() -> str:
        raise RenderUnavailable("no video: install OpenGL")

    monkeypatch.setattr(render, "_backend", nothing)
    with pytest.raises(SystemExit) as stopped:
        main(["export-data", str(path), "-o", str(tmp_path / "out-v0"), *arguments])
    assert stopped.value.code == code
    told = capsys.readouterr().err
    assert message in told
    assert len(told.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_minari_has_no_pictures(data: TrajectoryData, tmp_path: Path) -> None:
    pytest.importorskip("h5py", reason="the extra data is not installed")
    with pytest.raises(InputError, match="for lerobot alone"):
        export_data(data, tmp_path / "out-v0", "minari", VIEW)
