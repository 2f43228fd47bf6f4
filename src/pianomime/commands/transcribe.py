"""`pianomime transcribe`, and the transcription that `pianomime play` makes as well."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    from pianomime.video.recording_notes import RecordingConfig

_READ = {"sound": "heard", "light": "saw", "light and sound": "saw and heard"}
"""What was done to the notes, by what they are from."""


@dataclass(frozen=True)
class Transcribe:
    """Write down the notes of a recording of a piano, as a MIDI file with velocities and pedal.

    It takes about as long as the recording on two cores. In a film of falling notes, or another
    one whose keys light up, light tells the keys, and the sound the rest. `pianomime retarget` also
    finds which finger of a person in a video plays each note.

    Examples:
      pianomime transcribe SONG.mp3
      pianomime transcribe SONG.wav -o SONG.mid
      pianomime transcribe VIDEO.mp4 -o SONG.mid
      pianomime transcribe FALLING-NOTES.mp4 --notes light
      pianomime play SONG.mid
    """

    recording: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="SOUND|VIDEO")]
    """A recording of a piano alone: WAV, MP3, FLAC, or anything else that FFmpeg reads; or a film
    of a keyboard whose keys light up."""
    notes: Literal["auto", "sound", "light"] = "auto"
    """What the notes are taken from: the sound, or keys that light up in a film. By default both
    where they agree, and else what there is."""
    points: Annotated[Path | None, tyro.conf.arg(metavar="POINTS.json", help_behavior_hint="")] = (
        None
    )
    """Points of a film's keyboard from `pianomime pick`; by default it is found automatically."""
    octave: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Octave of the lowest C that is seen, 4 for the middle C; by default it is found out."""
    mirrored: tyro.conf.FlagCreatePairsOff[bool] = False
    """The film is mirrored; by default that is found out."""
    not_mirrored: tyro.conf.FlagCreatePairsOff[bool] = False
    """The film is not mirrored."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="SONG.mid", help_behavior_hint="")
    ] = None
    """File for the notes; by default out/RECORDING.mid."""

    def run(self) -> None:
        """Write the MIDI file, and print what was heard.

        Raises:
            InputError: no notes can be heard in this file, or the extra is not installed.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.mirrored import mirrored_or_not
        from pianomime.errors import InputError
        from pianomime.file_names import file_name
        from pianomime.shown import command_word
        from pianomime.video.recording_notes import RecordingConfig

        out = self.out or Path("out", file_name(self.recording.stem) + ".mid")
        if out.suffix.lower() not in (".mid", ".midi"):
            raise InputError(f"{out}: the name of a MIDI file must end in .mid")
        if out.is_dir():
            raise InputError(f"{out}: is a folder; a file is needed")
        mirrored = mirrored_or_not(self.mirrored, self.not_mirrored)
        config = RecordingConfig(self.notes, self.points, self.octave, mirrored)
        write_transcription(self.recording, out, config)
        print(f"next: pianomime play {command_word(out)}")


def write_transcription(recording: Path, out: Path, config: RecordingConfig) -> None:
    """Write the notes of a recording into a MIDI file, and print what they are from.

    Args:
        recording: a file of sound, or a film.
        out: the MIDI file; its folder is made.
        config: what is known about the recording, and what of it is wanted.

    Raises:
        InputError: there are no notes in this file, or what hears them is not installed.
        OSError: a file cannot be read or written.
    """
    from pianomime.commands.progress import bars
    from pianomime.files import staged
    from pianomime.shown import shown
    from pianomime.video.recording_notes import notes_of_recording

    # The folder first: if it cannot be written, this fails before the work, not after.
    with staged(out.parent, {out.name}, out.name) as folder, bars() as progress:
        score, source = notes_of_recording(recording, config, progress)
        score.to_midi(folder / out.name)
    pedal = "" if source == "light" else f", and the pedal {len(score.pedal)} times"
    print(f"{_READ[source]} {len(score)} notes in {score.duration:.1f} s{pedal}")
    for doubt in score.remarks:
        print(f"note: {shown(doubt)}")
    print(f"transcription: {shown(out)}")
