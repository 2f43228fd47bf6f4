"""`pianomime export-data`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.learn.export.data_export import DataFormat


@dataclass(frozen=True)
class ExportData:
    """Write a data set of trajectories for LeRobot or Minari, to train with their methods.

    LeRobot: a LeRobotDataset v3.0 (Parquet). `observation.state` is joints, velocities and keys;
    `observation.environment_state` the keys that are wanted in this frame and the next three, and
    the fingertips of the plan in these; `action` the controls of the expert; the task is the song.

    Minari: the same as a dictionary of observations (HDF5), with the F1 of each frame as reward.
    The name of OUT ends in a version, as Minari wants it.

    Examples:
      pianomime export-data out/dagger.zarr -o out/piano
      pianomime export-data out/dagger.zarr -o out/piano-v0 --format minari
      pianomime export-data DATA -o ~/.minari/datasets/piano-v0 --format minari
    """

    data: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DATA")]
    """A data set of `pianomime collect` or `pianomime collect-dagger`."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")]
    """Folder of the export; an older export at its place is replaced."""
    format: DataFormat = "lerobot"
    """Of the export: that of the library which is to read it."""

    def run(self) -> None:
        """Export, and print what it holds.

        Raises:
            InputError: there is no data set, it is damaged, something else than an export is at the
                place, or a package is missing.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.needs import need_folder, need_packages
        from pianomime.commands.progress import bars
        from pianomime.learn.export.data_export import PACKAGES, export_data
        from pianomime.progress import telling
        from pianomime.shown import shown

        need_packages("data", PACKAGES[self.format])
        need_folder(self.out.absolute().parent)
        with extra("data"), bars() as progress, telling(progress):
            from pianomime.learn.data.trajectories import TrajectoryData

            data = TrajectoryData.open(self.data)
            export_data(data, self.out, self.format)
        print(f"for {self.format}: {len(data)} episodes, {int(data.ends[-1])} frames")
        print(f"saved: {shown(self.out)}")
