"""Exports of data sets for other libraries: what marks one on disk, and what is written into it.

Cheap to import: no numpy, no zarr.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pianomime.errors import InputError
from pianomime.files import new_folder
from pianomime.sealed_json import read_json

if TYPE_CHECKING:
    from pianomime.learn.data.trajectories import TrajectoryData
    from pianomime.world.render import View

DataFormat = Literal["lerobot", "minari"]
"""The formats of exports, by the library that reads each."""
PACKAGES: dict[DataFormat, tuple[str, ...]] = {
    "lerobot": ("pyarrow", "zarr"),
    "minari": ("h5py", "zarr"),
}
"""The packages that each needs, of the extra "data"."""
MARK = "pianomime.json"
"""The file that marks an export; it says what each number is."""
FORMAT = "pianomime data export"
VERSION = 1
"""Of what the mark says."""


def is_data_export(path: Path) -> bool:
    """Whether a folder is an export of a data set, of any version and for any library."""
    try:
        mark = read_json(path / MARK)
    except (OSError, ValueError):
        return False
    return isinstance(mark, dict) and mark.get("format") == FORMAT


def export_data(
    data: TrajectoryData, path: Path, data_format: DataFormat, view: View | None = None
) -> None:
    """Write a data set for another library, all or nothing; an older export is replaced.

    Args:
        data: the data set.
        path: of the folder; those that it is in are made.
        data_format: of the export.
        view: which camera takes a picture of every frame, and of which size; None for no pictures,
            which Minari never has.

    Raises:
        InputError: there is something else at the place, its name is not one that Minari allows,
            there is no such picture, another process writes there, or the data set is damaged.
        OSError: it cannot be written.
        RenderUnavailable: there are to be pictures, and there is no working OpenGL.
        ModuleNotFoundError: a package of `PACKAGES` is not installed.
    """
    world = data.episodes[0]["world"]
    if data_format == "minari":
        from pianomime.learn.export.minari import check_minari_name

        if view is not None:
            raise InputError("pictures of a camera are written for lerobot alone, not for minari")
        check_minari_name(path)
    elif view is not None:
        from pianomime.learn.export.camera import check_view

        check_view(view)
    if Path(os.path.realpath(path)).parent.is_relative_to(os.path.realpath(data.path)):
        raise InputError(f"{path}: is in the data set itself, with which it would go")
    path.parent.mkdir(parents=True, exist_ok=True)
    with new_folder(path, is_data_export, "an export of a data set") as folder:
        folder.mkdir()
        if data_format == "lerobot":
            from pianomime.learn.export.lerobot import feature_names, write_lerobot

            numbers = feature_names(world)
            write_lerobot(data, folder, view)
        else:
            from pianomime.learn.export.minari import write_minari
            from pianomime.learn.export.named_rows import names

            numbers = names(world)
            write_minari(data, folder, path.name)
        mark = {
            "format": FORMAT,
            "version": VERSION,
            "library": data_format,
            "world": world,
            "numbers": numbers,
        }
        text = json.dumps(mark, indent=1, ensure_ascii=False)
        (folder / MARK).write_text(text + "\n", encoding="utf-8")
