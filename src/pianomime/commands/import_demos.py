"""`pianomime import-demos`."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class ImportDemos:
    """Import the paper's published demonstrations, with their known faults repaired.

    SOURCE is a folder with PianoMime's high-level zarr data set, an .npz file of several clips
    (length, fingertips, goal_packed), or one of a single clip (fingertips, goal). OUT then holds
    one .npz for each clip of every split; `pianomime train` and `pianomime collect-dagger` use
    those of the split "train" alone.

    Examples:
      pianomime import-demos DATASET.zarr -o demos
      pianomime import-demos reference.npz -o demos
    """

    source: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="SOURCE")]
    """The published data."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT", help_behavior_hint="")
    ] = None
    """Folder for the demonstrations; out/demos-SOURCE if not given."""
    clips: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Import only the first N."""

    def run(self) -> None:
        """Import.

        Raises:
            InputError: the data are not what they should be.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.needs import demonstration_files, need_folder, need_packages
        from pianomime.commands.progress import bars
        from pianomime.errors import InputError
        from pianomime.file_names import file_name
        from pianomime.short_repr import count
        from pianomime.shown import shown
        from pianomime.validation import within

        if not self.source.exists():
            raise InputError(f"{self.source}: does not exist")
        if self.source.is_dir():
            need_packages("video", ("zarr",))
        if self.clips is not None:
            within("clips", self.clips, 1)
        out = self.out or Path("out", f"demos-{file_name(self.source.resolve().stem)}")
        need_folder(out)
        from pianomime.files import staged
        from pianomime.learn.data.published import read_published

        number = 0
        with staged(out, ()) as folder, bars() as progress:
            progress("reading", 0, 0)
            for demonstration, total in read_published(self.source, self.clips):
                demonstration.save(folder / f"{file_name(demonstration.score.title)}.npz")
                number += 1
                progress("importing", number, total)
            written = {path.name for path in folder.iterdir()}
        there = demonstration_files(out)
        others = [path for path in there if path.parent != out or path.name not in written]
        if others:
            files = count(len(others), "more .npz file")
            warnings.warn(
                f"{out}: holds {files} of before; what learns from the folder learns from them, "
                "too",
                stacklevel=2,
            )
        print(f"saved {number} demonstrations: {shown(out)}")
