"""`pianomime import-demos`."""

from __future__ import annotations

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
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = None
    """Folder for the demonstrations; out/demos-SOURCE if not given."""
    clips: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Import only the first N."""

    def run(self) -> None:
        """Import.

        Raises:
            InputError: the data are not what they should be.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.progress import bars
        from pianomime.files import staged
        from pianomime.learn.data.published import read_published

        out = self.out or Path("out", f"demos-{self.source.stem}")
        number = 0
        with staged(out, ()) as folder, bars() as progress:
            for demonstration, total in read_published(self.source, self.clips):
                demonstration.save(folder / f"{demonstration.score.title}.npz")
                number += 1
                progress("importing", number, total)
        print(f"saved {number} demonstrations: {out}")
