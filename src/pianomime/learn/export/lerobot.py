"""LeRobotDataset v3.0: a data set of trajectories as LeRobot and the hub of Hugging Face read it.

The data are Parquet files with one row a frame and one row group an episode; `meta/` says where
each episode is, what the numbers are, and their statistics, by which policies normalize them. There
are pictures where a camera is wanted: H.264 in `videos/`. The features:

- `observation.state`: joint positions, joint velocities, and how far each key is down;
- `observation.environment_state`: what is to be played, in this frame and those that follow: the
  keys that are wanted, then the fingertips of the plan;
- `action`: the controls of the expert;
- `observation.images.<camera>`: the picture of the state.
"""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE
from pianomime.learn.data.trajectories import TrajectoryData
from pianomime.learn.export.camera import VIDEO, VIDEO_MIB, Camera, open_camera
from pianomime.learn.export.feature_stats import QUANTILES, RunningStats, episode_stats
from pianomime.learn.export.named_rows import COLUMNS_READ, names, rows
from pianomime.learn.export.numbered_files import FILES_IN_CHUNK
from pianomime.learn.export.parquet_files import ParquetFiles
from pianomime.progress import Steps
from pianomime.world.render import View

VERSION = "v3.0"
"""Of the format."""
ROBOT = "two_shadow_hands_at_a_piano"
"""The type of robot."""
_FILE_MIB = 100
"""[MiB] of a file of data at most, as LeRobot has it by default; one episode may be larger."""
_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_ARRAYS = {
    "observation.state": ("joints", "velocities", "keys"),
    "observation.environment_state": ("goals", "fingertips"),
    "action": ("action",),
}
"""The arrays of `named_rows` that make up each feature, one after the other."""
_INDICES = ("frame_index", "episode_index", "index", "task_index")
"""Features of whole numbers that every LeRobotDataset has."""
_STATS = ("min", "max", "mean", "std", "count", *QUANTILES)


def feature_names(world: str) -> dict[str, tuple[str, ...]]:
    """The name of each number of each feature, with its unit.

    Args:
        world: name of the world that the episodes were played in.
    """
    of_arrays = names(world)
    return {
        feature: tuple(name for array in arrays for name in of_arrays[array])
        for feature, arrays in _ARRAYS.items()
    }


def write_lerobot(data: TrajectoryData, folder: Path, view: View | None = None) -> None:
    """Write a data set as a LeRobotDataset v3.0.

    Episodes are in the order of their splits, those for training first, so that each split is a
    range of episodes. The task of an episode is the name of its song.

    Args:
        data: the data set.
        folder: where to write; it exists and is empty.
        view: the camera, and the size of its pictures; None for an export without pictures.

    Raises:
        InputError: the data set is damaged.
        OSError: it cannot be written.
        RenderUnavailable: there are to be pictures, and there is no working OpenGL.
    """
    facts = data.episodes
    order = sorted(
        range(len(data)), key=lambda at: (facts[at]["split"] != "train", facts[at]["split"], at)
    )
    tasks: dict[str, int] = {}
    for at in order:
        tasks.setdefault(facts[at]["name"], len(tasks))
    named = feature_names(facts[0]["world"])
    running = RunningStats(int(data.ends[-1]))
    steps = Steps("exporting", int(data.ends[-1]))
    first_row = 0
    with ExitStack() as stack:
        camera = None if view is None else stack.enter_context(open_camera(folder, view))
        frames_out = stack.enter_context(
            ParquetFiles(folder, _DATA, _FILE_MIB, _data_schema(named))
        )
        episodes_out = stack.enter_context(
            ParquetFiles(folder, _EPISODES, _FILE_MIB, _episodes_schema(named, camera))
        )
        for index, at in enumerate(order):
            columns = data.columns(at, COLUMNS_READ)
            features = _features(columns, index, first_row, tasks[facts[at]["name"]])
            stats = {name: episode_stats(values) for name, values in features.items()}
            running.add(features, stats)
            of_video: dict[str, Any] = {}
            if camera is None:
                steps.advance(len(features["index"]))
            else:
                of_video, stats[camera.feature] = camera.record(columns, steps.advance)
            count = len(features["index"])
            chunk, file = frames_out.write(_data_table(features, frames_out.schema))
            row = {
                "episode_index": index,
                "tasks": [facts[at]["name"]],
                "length": count,
                "data/chunk_index": chunk,
                "data/file_index": file,
                "dataset_from_index": first_row,
                "dataset_to_index": first_row + count,
                **of_video,
                "split": facts[at]["split"],
                "song_id": facts[at]["song_id"],
                "f1": facts[at]["f1"],
                **{
                    f"stats/{name}/{stat}": of_feature[stat].tolist()
                    for name, of_feature in stats.items()
                    for stat in _STATS
                },
            }
            episodes_out.write_row(row)
            first_row += count
    splits = [facts[at]["split"] for at in order]
    info = {
        "codebase_version": VERSION,
        "robot_type": ROBOT,
        "total_episodes": len(order),
        "total_frames": first_row,
        "total_tasks": len(tasks),
        "chunks_size": FILES_IN_CHUNK,
        "data_files_size_in_mb": _FILE_MIB,
        "video_files_size_in_mb": VIDEO_MIB,
        "fps": int(FRAME_RATE),
        "splits": {
            split: f"{splits.index(split)}:{splits.index(split) + splits.count(split)}"
            for split in dict.fromkeys(splits)
        },
        "data_path": _DATA,
        "video_path": None if camera is None else VIDEO,
        "features": _described(named, camera),
    }
    _write_json(folder / "meta" / "info.json", info)
    of_all = running.of_all()
    if camera is not None:
        of_all[camera.feature] = camera.stats()
    stats_of_all = {
        name: {stat: stats[stat].tolist() for stat in _STATS} for name, stats in of_all.items()
    }
    _write_json(folder / "meta" / "stats.json", stats_of_all)
    # Not by its path, of which not every name can be turned into UTF-8.
    with (folder / "meta" / "tasks.parquet").open("wb") as sink:
        pq.write_table(_tasks_table(tasks), sink)


def _features(
    columns: dict[str, NDArray[Any]], episode: int, first_row: int, task: int
) -> dict[str, NDArray[Any]]:
    """All features of an episode, (T, n) each."""
    arrays = rows(columns)
    count = len(arrays["action"])
    made: dict[str, NDArray[Any]] = {
        feature: np.concatenate([arrays[name].reshape(count, -1) for name in parts], axis=1)
        for feature, parts in _ARRAYS.items()
    }
    frame = np.arange(count)[:, None]
    made["timestamp"] = (frame / FRAME_RATE).astype(np.float32)
    made["frame_index"] = frame
    made["episode_index"] = np.full_like(frame, episode)
    made["index"] = first_row + frame
    made["task_index"] = np.full_like(frame, task)
    return made


def _data_schema(named: dict[str, tuple[str, ...]]) -> pa.Schema:
    vectors = [(feature, pa.list_(pa.float32(), len(each))) for feature, each in named.items()]
    indices = [(name, pa.int64()) for name in _INDICES]
    return pa.schema([*vectors, ("timestamp", pa.float32()), *indices])


def _data_table(features: dict[str, NDArray[Any]], schema: pa.Schema) -> pa.Table:
    columns = []
    for field in schema:
        flat = pa.array(features[field.name].ravel())
        if pa.types.is_fixed_size_list(field.type):
            flat = pa.FixedSizeListArray.from_arrays(flat, field.type.list_size)
        columns.append(flat)
    return pa.Table.from_arrays(columns, schema=schema)


def _episodes_schema(named: dict[str, tuple[str, ...]], camera: Camera | None) -> pa.Schema:
    whole, number = pa.int64(), pa.float64()
    of_feature = dict.fromkeys((*named, "timestamp", *_INDICES), pa.list_(number))
    of_video = []
    if camera is not None:
        # (3, 1, 1), which broadcasts over the pixels of a picture.
        of_feature[camera.feature] = pa.list_(pa.list_(pa.list_(number)))
        of_video = [
            (f"videos/{camera.feature}/chunk_index", whole),
            (f"videos/{camera.feature}/file_index", whole),
            (f"videos/{camera.feature}/from_timestamp", number),
            (f"videos/{camera.feature}/to_timestamp", number),
        ]
    return pa.schema(
        [
            ("episode_index", whole),
            ("tasks", pa.list_(pa.string())),
            ("length", whole),
            ("data/chunk_index", whole),
            ("data/file_index", whole),
            ("dataset_from_index", whole),
            ("dataset_to_index", whole),
            *of_video,
            # What LeRobot does not ask for, and episodes are chosen by.
            ("split", pa.string()),
            ("song_id", whole),
            ("f1", number),
            *(
                (f"stats/{name}/{stat}", pa.list_(whole) if stat == "count" else numbers)
                for name, numbers in of_feature.items()
                for stat in _STATS
            ),
            ("meta/episodes/chunk_index", whole),
            ("meta/episodes/file_index", whole),
        ]
    )


def _described(
    named: dict[str, tuple[str, ...]], camera: Camera | None
) -> dict[str, dict[str, Any]]:
    """The features as `info.json` has them."""
    vectors = {
        feature: {"dtype": "float32", "shape": [len(each)], "names": list(each)}
        for feature, each in named.items()
    }
    one = {"shape": [1], "names": None}
    indices = {name: {"dtype": "int64", **one} for name in _INDICES}
    pictures = {} if camera is None else {camera.feature: camera.described()}
    return {**vectors, **pictures, "timestamp": {"dtype": "float32", **one}, **indices}


def _tasks_table(tasks: dict[str, int]) -> pa.Table:
    """Tasks by their numbers, with what tells pandas that the text is the index."""
    table = pa.table({"task_index": pa.array(tasks.values(), pa.int64()), "task": list(tasks)})
    text = {"name": "task", "field_name": "task", "pandas_type": "unicode", "numpy_type": "object"}
    number = {"name": "task_index", "field_name": "task_index", "pandas_type": "int64"}
    pandas = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [
            {**number, "numpy_type": "int64", "metadata": None},
            {**text, "metadata": None},
        ],
    }
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(content, indent=4, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
