"""`pianomime score`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from pianomime.keyboard import EXCERPT_SECONDS

if TYPE_CHECKING:
    from pianomime.music import Score


@dataclass(frozen=True)
class ScorePlaying:
    """Score a playing by the music protocol: notes, touch, chords, repeated notes and pedal.

    The playing may be anybody's: a performance of ours, or a MIDI file that another program, robot
    or person has made. It is compared in true time, and no lag is taken off.

    Examples:
      pianomime score out/SONG/performance.npz
      pianomime score PLAYED.mid --against SONG.mid
      pianomime score performance.mid --against SONG.mid --lead-in 0.5
      pianomime score PLAYED.mid --against SONG.mid --no-trim --seconds inf --json
    """

    played: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PLAYED")]
    """What was played: a performance (.npz) or a MIDI file."""
    against: Annotated[str | None, tyro.conf.arg(metavar="SONG", help_behavior_hint="")] = None
    """What was to be played: a MIDI file, or the name of a bundled song. A performance has its
    own."""
    start: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0
    """Where in SONG the playing begins [s]."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = EXCERPT_SECONDS
    """How much of SONG to score at most [s]; inf for all of it."""
    lead_in: Annotated[float | None, tyro.conf.arg(metavar="S", help_behavior_hint="")] = None
    """How long PLAYED is silent before its first sound is due [s], as `pianomime play --lead-in`
    has it: 0.5 in its performance.mid. If not given, 0 for MIDI files, and what a performance's own
    score has."""
    trim: bool = True
    """Whether PLAYED begins with LEAD-IN and the first sound of SONG at or after START, as what
    `pianomime play` writes does. Otherwise time runs alike in both files, from their
    beginnings."""
    json: bool = False
    """Print JSON: `song`, `protocol` and the object `music`."""

    def run(self) -> None:
        """Score and print.

        Raises:
            InputError: a file is of another kind or damaged, or it is not known what was to be
                played.
            OSError: a file cannot be read.
        """
        import json
        from dataclasses import asdict, replace

        from rich.console import Console
        from rich.table import Table
        from rich.text import Text

        from pianomime.evaluation.measures import MORE_MUSIC, MUSIC
        from pianomime.evaluation.summary import json_of
        from pianomime.music import music_metrics, protocol_digest

        score, played, pedalled = self._load()
        metrics = music_metrics(score, played)
        if not pedalled:
            metrics = replace(metrics, pedal_lifts_kept=None)
        row = {
            "song": score.title,
            "protocol": protocol_digest(),
            "music": json_of(asdict(metrics)),
        }
        if self.json:
            print(json.dumps(row, indent=2, ensure_ascii=False, allow_nan=False))
            return
        # Texts, not strs, in which rich would look for markup.
        table = Table(title=Text(score.title), title_style="bold", show_header=False)
        for measure in (*MUSIC, *MORE_MUSIC):
            table.add_row(Text(measure.label), measure.show(row))
        Console().print(table)

    def _load(self) -> tuple[Score, Score, bool]:
        """What was to be played, and what was, in one time; and whether its pedal was played."""
        from pianomime.errors import InputError
        from pianomime.music import Score, excerpt
        from pianomime.players.performance import Performance
        from pianomime.songs.find import find_song

        performance = Performance.load(self.played) if self.played.suffix == ".npz" else None
        if self.against is None:
            for name in ("start", "seconds", "lead_in", "trim"):
                if getattr(self, name) != getattr(ScorePlaying, name):
                    option = name.replace("_", "-")
                    raise InputError(f"--{option} is a part of a song: name that with --against")
            if performance is None:
                raise InputError(
                    f"{self.played}: say what was to be played with --against SONG.mid"
                )
            return performance.score, performance.played(), performance.works_pedal
        song = Score.from_midi(find_song(self.against))
        played = Score.from_midi(self.played) if performance is None else performance.played()
        pedalled = performance is None or performance.works_pedal
        if not self.trim:
            if self.lead_in is not None:
                raise InputError("--lead-in: with --no-trim, time runs alike in both files")
            begins, ends = self.start, self.start + self.seconds
            return song.clip(begins, ends), _heard(played, begins, ends), pedalled
        lead_in = 0.0 if self.lead_in is None else self.lead_in
        if self.lead_in is None and performance is not None and len(performance.score):
            lead_in = float(performance.score.onset[0])
        score = excerpt(song, self.start, self.seconds, lead_in)
        return score, _heard(played, 0.0, lead_in + self.seconds), pedalled


def _heard(played: Score, begin: float, end: float) -> Score:
    """What was played between two times [s], which may be nothing."""
    from dataclasses import replace

    heard = (played.offset > begin) & (played.onset < end)
    if heard.any():
        return played.clip(begin, end)
    nothing = {name: getattr(played, name)[:0] for name in ("key", "onset", "offset", "velocity")}
    return replace(played, pedal=played.pedal[:0], **nothing)
