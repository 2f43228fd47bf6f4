"""`pianomime retarget`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

_REMARKS = 10
"""That are printed; hours of video make hundreds."""


@dataclass(frozen=True)
class Retarget:
    """Make a demonstration of a video of somebody playing, seen from above.

    DEMO.npz can then be played: `pianomime play DEMO.npz`. Beside it lie a page that shows how
    well hands and keys were seen (DEMO-seen.html) and the video with what was seen drawn into it
    (DEMO-seen.mp4).

    Examples:
      pianomime retarget VIDEO.mp4 --midi SONG.mid
      pianomime retarget VIDEO.mp4 --midi SONG.mid --points POINTS.json --offset -3.2
      pianomime retarget VIDEO.mp4 -o DEMO.npz --no-overlay
    """

    video: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="VIDEO")]
    """Any video in which a keyboard is seen from above."""
    midi: Annotated[Path | None, tyro.conf.arg(metavar="SONG.mid")] = None
    """What is played; if not given it is read off the video, where keys light up."""
    points: Annotated[Path | None, tyro.conf.arg(metavar="POINTS.json")] = None
    """Where the keyboard is, from `pianomime pick`; found by itself if not given."""
    offset: Annotated[float | None, tyro.conf.arg(metavar="S")] = None
    """When in the video the MIDI file begins [s], negative if before it; estimated if not given."""
    hand_model: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """MediaPipe's hand_landmarker.task; downloaded once if not given."""
    align: Literal["steady", "paper"] = "steady"
    """How fingertips are put on keys: the house's way, or step 3 of the paper's appendix A."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="DEMO.npz")] = None
    """The demonstration; out/VIDEO.npz if not given."""
    overlay: bool = True
    """Draw a video of what was seen."""

    def run(self) -> None:
        """Make the demonstration and tell how good it is.

        Raises:
            InputError: no demonstration can be made of what was given.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.progress import bars
        from pianomime.errors import InputError
        from pianomime.files import staged
        from pianomime.video.overlay import write_overlay
        from pianomime.video.retarget import RetargetConfig, retarget
        from pianomime.video.summary import write_summary

        out = self.out or Path("out", self.video.stem + ".npz")
        if out.suffix != ".npz":
            raise InputError(f"{out}: a demonstration is a file that ends in .npz")
        if out.exists() and out.is_dir():
            raise InputError(f"{out}: is a folder; a file is needed")
        # Names that nobody else gives: an earlier one of ours is replaced, or removed.
        overlay, page = (out.with_name(f"{out.stem}-seen{end}") for end in (".mp4", ".html"))
        ours = {file.name for file in (out, overlay, page)}
        if self.video.resolve() in (overlay.resolve(), page.resolve(), out.resolve()):
            raise InputError(f"{self.video}: would be overwritten; give OUT another name")
        config = RetargetConfig(self.midi, self.points, self.offset, self.hand_model, self.align)
        # The folder first: that it cannot be written shows before the work, not after. Whoever
        # interrupts this finds no picture of a demonstration that is not there.
        with staged(out.parent, ours) as folder, bars() as progress:
            made = retarget(self.video, config, progress)
            if self.overlay:
                write_overlay(made, folder / overlay.name, progress)
            write_summary(made, folder / page.name)
            made.demonstration.save(folder / out.name)
        quality = made.demonstration.quality
        print(f"keyboard: {quality['keyboard']}")
        print(f"both hands seen in {quality['both_hands_found']:.1%} of the frames")
        print(f"notes: {quality['notes']}, fingers guessed: {quality['notes_guessed']}")
        for remark in made.remarks[:_REMARKS]:
            print(f"note: {remark}")
        if len(made.remarks) > _REMARKS:
            print(f"note: {len(made.remarks) - _REMARKS} more such notes are in the page")
        print(f"look: {page}")
        print(f"play it: pianomime play {out}")
