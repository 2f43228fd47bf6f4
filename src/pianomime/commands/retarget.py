"""`pianomime retarget`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

_REMARKS = 10
"""Most remarks that are printed; hours of video can have hundreds."""


@dataclass(frozen=True)
class Retarget:
    """Make a demonstration of a video of a person who plays, filmed from above.

    The result can be played with `pianomime play DEMO.npz`. Two files beside it show how well
    hands and keys were seen: a page (DEMO-seen.html), and the video with hands, keys and fingers
    drawn into it (DEMO-seen.mp4).

    Examples:
      pianomime retarget VIDEO.mp4 --midi SONG.mid
      pianomime retarget VIDEO.mp4 --midi SONG.mid --points POINTS.json
      pianomime retarget VIDEO.mp4 --midi SONG.mid --offset -3.2
      pianomime retarget VIDEO.mp4 --notes sound
      pianomime retarget VIDEO.mp4 -o DEMO.npz --no-overlay
    """

    video: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="VIDEO")]
    """A video of a keyboard from above."""
    midi: Annotated[Path | None, tyro.conf.arg(metavar="SONG.mid", help_behavior_hint="")] = None
    """MIDI file of what is played; by default the notes are taken from the video."""
    notes: Literal["auto", "midi", "light", "sound"] = "auto"
    """What the notes are taken from: the MIDI file, keys that light up, or the sound of
    the video. By default the MIDI file if there is one, else light where keys light up, else sound
    where the extra `audio` is installed; where there is light, sound adds time, velocity and
    pedal."""
    points: Annotated[Path | None, tyro.conf.arg(metavar="POINTS.json", help_behavior_hint="")] = (
        None
    )
    """Points of the keyboard from `pianomime pick`; by default it is found automatically."""
    octave: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Octave of the lowest C that is seen, 4 for the middle C; by default it is found out."""
    mirrored: tyro.conf.FlagCreatePairsOff[bool] = False
    """The video is mirrored; by default that is found out."""
    not_mirrored: tyro.conf.FlagCreatePairsOff[bool] = False
    """The video is not mirrored."""
    offset: Annotated[float | None, tyro.conf.arg(metavar="S", help_behavior_hint="")] = None
    """When the MIDI file begins in the video [s], negative if before it; or how early its own sound
    is, negative if late. By default estimated."""
    hand_model: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """MediaPipe's hand_landmarker.task; by default downloaded once."""
    align: Literal["steady", "paper"] = "steady"
    """How fingertips are moved onto keys: smoothly, or as in the paper's appendix A, step 3."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="DEMO.npz", help_behavior_hint="")
    ] = None
    """File for the demonstration; by default out/VIDEO.npz."""
    overlay: bool = True
    """Write DEMO-seen.mp4."""

    def run(self) -> None:
        """Make the demonstration, and print how good it is and what to do.

        Raises:
            InputError: no demonstration can be made from these files.
            OSError: a file cannot be read or written.
        """
        from pianomime.video.hands.detector import check_mediapipe

        # Before the other imports, which take seconds.
        check_mediapipe()
        from pianomime.commands.mirrored import mirrored_or_not
        from pianomime.commands.progress import bars
        from pianomime.errors import InputError
        from pianomime.file_names import file_name
        from pianomime.files import staged
        from pianomime.shown import command_word, shown
        from pianomime.video.overlay import write_overlay
        from pianomime.video.retarget import RetargetConfig, retarget
        from pianomime.video.summary import write_summary

        out = self.out or Path("out", file_name(self.video.stem) + ".npz")
        if out.suffix != ".npz":
            raise InputError(f"{out}: the name of a demonstration must end in .npz")
        if out.exists() and out.is_dir():
            raise InputError(f"{out}: is a folder; a file is needed")
        # Files of these names are from earlier runs: they are replaced, or removed.
        overlay, page = (out.with_name(f"{out.stem}-seen{end}") for end in (".mp4", ".html"))
        ours = {file.name for file in (out, overlay, page)}
        if self.video.resolve() in (overlay.resolve(), page.resolve(), out.resolve()):
            raise InputError(f"{self.video}: would be overwritten; give OUT another name")
        config = RetargetConfig(
            self.midi,
            self.points,
            self.octave,
            mirrored_or_not(self.mirrored, self.not_mirrored),
            self.offset,
            self.hand_model,
            self.align,
            self.notes,
        )
        # The folder first: if it cannot be written, this fails before the work, not after. All
        # files appear together, so that an interruption leaves no page without its demonstration.
        with staged(out.parent, ours, out.name) as folder, bars() as progress:
            made = retarget(self.video, config, progress)
            if self.overlay:
                write_overlay(made, folder / overlay.name, progress)
            write_summary(made, folder / page.name)
            made.demonstration.save(folder / out.name)
        quality = made.demonstration.quality
        print(shown(made.verdict.line))
        print(f"keyboard: {quality['keyboard']}")
        print(
            f"notes: {quality['notes']}, from {shown(quality['notes_from'])}; "
            f"{quality['notes_touched']:.0%} have a finger on their key (shifted to other keys or "
            f"times, {quality['notes_touched_by_chance']:.0%} would)"
        )
        print(
            f"in doubt: {quality['seconds_in_doubt']:.1f} s of "
            f"{quality['seconds_with_keyboard']:.1f} s"
        )
        for remark in made.remarks[:_REMARKS]:
            print(f"note: {shown(remark.text)}")
            if remark.action:
                print(f"   do: {shown(remark.action)}")
        if len(made.remarks) > _REMARKS:
            print(f"note: {len(made.remarks) - _REMARKS} more such notes are on the page")
        print(f"page: {shown(page)}")
        print(f"next: pianomime play {command_word(out)}")
