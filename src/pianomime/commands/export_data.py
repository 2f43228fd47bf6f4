"""`pianomime export-data`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.camera_names import CameraName
from pianomime.learn.export.data_export import DataFormat

_SIZE = (320, 136)
"""Width and height of pictures [pixels]."""


@dataclass(frozen=True)
class ExportData:
    """Write a data set of trajectories for LeRobot or Minari, to train with their methods.

    LeRobot: a LeRobotDataset v3.0 (Parquet). `observation.state` is joints, velocities and keys;
    `observation.environment_state` the keys that are wanted in this frame and the next three, and
    the fingertips of the plan in these; `action` the controls that the expert sends, or would send
    in that state where noise or a policy played; the task is the song. With --camera there is a
    picture of every frame (H.264), `observation.images.NAME`.

    Minari: the same as a dictionary of observations (HDF5), with the F1 of each frame as reward.
    The name of OUT ends in a version, as Minari wants it.

    Examples:
      pianomime export-data out/dagger.zarr -o out/piano
      pianomime export-data out/songs.zarr -o out/seen --camera player
      pianomime export-data out/dagger.zarr -o out/piano-v0 --format minari
      pianomime export-data DATA -o ~/.minari/datasets/piano-v0 --format minari
    """

    data: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DATA")]
    """A data set of `pianomime collect`, `collect-dagger` or `perform`."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")]
    """Folder of the export; an older export at its place is replaced."""
    format: DataFormat = "lerobot"
    """Of the export: that of the library which is to read it."""
    camera: Annotated[CameraName | None, tyro.conf.arg(help_behavior_hint="")] = None
    """For lerobot: whose pictures of the recorded states are rendered, which needs OpenGL; player
    looks over the player's shoulders."""
    size: Annotated[tuple[int, int] | None, tyro.conf.arg(metavar="W H", help_behavior_hint="")] = (
        None
    )
    """Width and height of these pictures [pixels], even; 320 136 if not given. Player and top see
    all keys where the width is at least 2.3 times the height."""

    def run(self) -> None:
        """Export, and print what it holds.

        Raises:
            InputError: there is no data set, it is damaged, something else than an export is at the
                place, there is no such picture, a size is given for none, or a package is missing.
            WorkFailed: this machine cannot render.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.needs import need_folder, need_packages
        from pianomime.commands.progress import bars
        from pianomime.errors import InputError, WorkFailed
        from pianomime.learn.export.data_export import PACKAGES, export_data
        from pianomime.progress import telling
        from pianomime.shown import shown

        if self.size is not None and self.camera is None:
            raise InputError("--size is for pictures, which need a --camera")
        need_packages("data", PACKAGES[self.format])
        need_folder(self.out.absolute().parent)
        with extra("data"), bars() as progress, telling(progress):
            from pianomime.learn.data.trajectories import TrajectoryData
            from pianomime.world.render import RenderUnavailable, View

            data = TrajectoryData.open(self.data)
            view = None if self.camera is None else View(self.camera, self.size or _SIZE)
            try:
                export_data(data, self.out, self.format, view)
            except RenderUnavailable as error:
                raise WorkFailed(str(error)) from error
        print(f"for {self.format}: {len(data)} episodes, {int(data.ends[-1])} frames")
        print(f"saved: {shown(self.out)}")
