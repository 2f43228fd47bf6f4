"""`pianomime transcribe`, and the transcription that `pianomime play` makes as well."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Transcribe:
    """Write down the notes of a recording of a piano, as a MIDI file with velocities and pedal.

    It takes about as long as the recording on two cores. Of a video the sound alone is heard;
    `pianomime retarget --notes sound` also finds which finger plays each note.

    Examples:
      pianomime transcribe SONG.mp3
      pianomime transcribe SONG.wav -o SONG.mid
      pianomime transcribe VIDEO.mp4 -o SONG.mid
      pianomime play SONG.mid
    """

    recording: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="SOUND|VIDEO")]
    """A recording of a piano alone: WAV, MP3, FLAC, or anything else that FFmpeg reads."""
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
        from pianomime.errors import InputError
        from pianomime.file_names import file_name
        from pianomime.shown import command_word

        out = self.out or Path("out", file_name(self.recording.stem) + ".mid")
        if out.suffix.lower() not in (".mid", ".midi"):
            raise InputError(f"{out}: the name of a MIDI file must end in .mid")
        if out.is_dir():
            raise InputError(f"{out}: is a folder; a file is needed")
        write_transcription(self.recording, out)
        print(f"next: pianomime play {command_word(out)}")


def write_transcription(recording: Path, out: Path) -> None:
    """Transcribe a recording into a MIDI file, and print what was heard.

    Args:
        recording: a file with sound.
        out: the MIDI file; its folder is made.

    Raises:
        InputError: no notes can be heard in this file, or the extra is not installed.
        OSError: a file cannot be read or written.
    """
    from pianomime.commands.progress import bars
    from pianomime.files import staged
    from pianomime.shown import shown
    from pianomime.transcription.listener import check_listener
    from pianomime.transcription.recording import Recording
    from pianomime.transcription.transcribe import transcribe

    given = Recording.of(recording)
    check_listener()
    # The folder first: if it cannot be written, this fails before the work, not after.
    with staged(out.parent, {out.name}, out.name) as folder, bars() as progress:
        score = transcribe(given, progress=progress)
        score.to_midi(folder / out.name)
    pedal = len(score.pedal)
    print(f"heard {len(score)} notes in {score.duration:.1f} s, and the pedal {pedal} times")
    for doubt in score.remarks:
        print(f"note: {shown(doubt)}")
    print(f"transcription: {shown(out)}")
