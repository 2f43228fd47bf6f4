"""`pianomime gallery`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Gallery:
    """Make a static site of performances, which anybody can host, and which needs no server.

    SITE then holds an index (index.html) whose cards can be sorted by any metric, and a page for
    each performance with its replay in 3D, its sound and its metrics. The same command goes on
    where it was stopped, and makes only pages that are not there.

    Examples:
      pianomime gallery out/SONG out/OTHER -o site
      pianomime gallery out/all -o site --title "Etude-12, effort 1"
      pianomime gallery out/all/songs/SONG-*.npz -o site
    """

    results: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="RESULTS...", help_behavior_hint="(required)"),
    ]
    """Folders that `pianomime play` or `pianomime evaluate` wrote, or performances in them."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="SITE")] = Path("out/gallery")
    """Folder of the site."""
    title: Annotated[str, tyro.conf.arg(metavar="TEXT")] = "Performances"
    """Heading of the index."""
    jobs: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Pages to make at a time; one for each core if not given."""

    def run(self) -> None:
        """Write the site.

        Raises:
            InputError: nothing that can be shown is given.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.progress import bars
        from pianomime.errors import InputError
        from pianomime.report.gallery import INDEX, performances_of, write_gallery
        from pianomime.shown import shown

        if not self.results:
            raise InputError("no results to show")
        if self.jobs is not None and self.jobs < 1:
            raise InputError(f"--jobs must be at least 1, not {self.jobs}")
        performances = performances_of(self.results)
        notes: list[str] = []
        with bars() as progress:
            rows = write_gallery(
                performances,
                self.out,
                self.title,
                self.jobs,
                progress,
                notes.append,
            )
        for note in notes:
            print(shown(note))
        print(f"{len(rows)} of {len(performances)}: {shown(self.out / INDEX)}")
