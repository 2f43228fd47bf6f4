"""Minari: a data set of trajectories in the HDF5 files that the library Minari reads.

A step has the observation before its action; Minari also wants the one after the last action, which
a data set does not hold. So each episode is given without its last action, and ends truncated.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.data.trajectories import TrajectoryData
from pianomime.learn.export.named_rows import COLUMNS_READ, rows
from pianomime.music import frame_metrics
from pianomime.progress import Steps
from pianomime.shown import shown

VERSION = "0.5.0"
"""The first version of Minari whose files are as these; later ones read them."""
_NAME = re.compile(r"[A-Za-z0-9_-]+-v[0-9]+")
"""Names of data sets, after which Minari looks for their folders."""
_FROM_0_TO_1 = ("keys", "goals")
"""Observations that are within 0..1; others have no bounds."""


def check_minari_name(path: Path) -> None:
    """Refuse a folder whose name cannot be that of a data set of Minari.

    Raises:
        InputError: the name does not end in a version, or has other characters in it.
    """
    if not _NAME.fullmatch(path.name):
        raise InputError(
            f"{path}: Minari wants a name of letters, digits, - and _ with a version, such as "
            "expert-v0"
        )


def write_minari(data: TrajectoryData, folder: Path, name: str) -> None:
    """Write a data set in the form of Minari.

    The reward of a step is the F1 of the keys that sound after it.

    Args:
        data: the data set.
        folder: where to write; it exists and is empty.
        name: of the data set, such as "expert-v0".

    Raises:
        InputError: the data set is damaged, or an episode has but one frame.
        OSError: it cannot be written.
    """
    home = folder / "data"
    home.mkdir()
    steps = Steps("exporting", len(data))
    total = 0
    spaces: dict[str, str] = {}
    with h5py.File(home / "main_data.hdf5", "w", track_order=True) as file:
        for number, facts in enumerate(data.episodes):
            columns = data.columns(number, (*COLUMNS_READ, "pressed"))
            if len(columns["action"]) == 1:
                raise InputError(f"{shown(facts['name'])} has one frame, of which no step is made")
            arrays = rows(columns)
            actions = arrays.pop("action")
            spaces = {"observation_space": _observations(arrays), "action_space": _box(actions)}
            count = len(actions) - 1
            group = file.create_group(f"episode_{number}", track_order=True)
            group.attrs["id"] = number
            group.attrs["total_steps"] = count
            for fact in ("name", "f1", "song_id", "split", "world"):
                group.attrs[fact] = facts[fact]
            for key, array in arrays.items():
                _put(group, f"observations/{key}", array)
            _put(group, "actions", actions[:-1])
            _put(group, "rewards", _rewards(columns)[:-1])
            _put(group, "terminations", np.zeros(count, bool))
            _put(group, "truncations", np.arange(count) == count - 1)
            # Minari's own code prints the names in it, and fails where it is missing.
            group.create_group("infos")
            total += count
            steps.advance(1)
    content = {
        "total_episodes": len(data),
        "total_steps": total,
        "data_format": "hdf5",
        "dataset_id": name,
        "minari_version": VERSION,
        **spaces,
        "description": "Two simulated hands play the piano, written by PianoMime; pianomime.json "
        "names each number.",
        "dataset_size": round((home / "main_data.hdf5").stat().st_size / 1e6, 1),
    }
    (home / "metadata.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def _rewards(columns: dict[str, NDArray[Any]]) -> NDArray[np.float64]:
    """(T,) F1 of each frame."""
    pairs = zip(columns["goal"], columns["pressed"], strict=True)
    return np.array([frame_metrics(goal[None], pressed[None]).f1 for goal, pressed in pairs])


def _put(group: h5py.Group, name: str, values: NDArray[Any]) -> None:
    group.create_dataset(name, data=values, chunks=True, compression="gzip", shuffle=True)


def _observations(arrays: dict[str, NDArray[Any]]) -> str:
    """The space of observations, as Minari writes spaces of Gymnasium."""
    parts = {name: json.loads(_box(array, name in _FROM_0_TO_1)) for name, array in arrays.items()}
    return json.dumps({"type": "Dict", "subspaces": parts})


def _box(values: NDArray[Any], from_0_to_1: bool = False) -> str:
    shape = values.shape[1:]
    low, high = (0.0, 1.0) if from_0_to_1 else (-np.inf, np.inf)
    return json.dumps(
        {
            "type": "Box",
            "dtype": str(values.dtype),
            "shape": list(shape),
            "low": np.full(shape, low).tolist(),
            "high": np.full(shape, high).tolist(),
        }
    )
