"""`pianomime play`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from rich.table import Table

    from pianomime.evaluation.summary import Row
    from pianomime.music import Score
    from pianomime.players.player import Player


@dataclass(frozen=True)
class Play:
    """Play a song with two simulated hands, and report on it.

    OUT then holds a page to look at and listen to (report.html), the numbers (report.json), the
    performance itself (performance.npz) and as MIDI, WAV, picture and film.

    Examples:
      pianomime play ode-to-joy
      pianomime play SONG.mid -o out/song --no-video
      pianomime play SONG.mid --effort 3
      pianomime play SONG.mid --start 60 --seconds 180
      pianomime play DEMO.npz --player demonstration-ik
      pianomime play SONG.mid --player RUN
    """

    song: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SONG")]
    """A MIDI file, a demonstration (see `pianomime retarget`), or the name of a bundled song (see
    `pianomime songs`)."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = None
    """Folder for the report; out/NAME if not given."""
    player: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Name of the player; zero-shot if not given, and for demonstrations, demonstration. Or the
    folder of an expert (see `pianomime train-expert`), which plays what it was trained on."""
    effort: Annotated[int, tyro.conf.arg(metavar="0..3")] = 1
    """How hard to try: 0 plays in one pass; 1 to 3 first try variations where notes would go wrong.
    On two cores 1 takes about as long as the music or less, 2 and 3 several times longer. For
    players that imitate it is 2, 5, 20 or 100 steps of a diffusion."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = 30.0
    """How much to play at most, from what sounds at START or first after it [s]."""
    start: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0
    """Where in the song to begin [s]."""
    video: bool = True
    """Render a film, where this machine can."""

    def run(self) -> None:
        """Play and write the report.

        Raises:
            InputError: there is nothing to play, or no such player.
            OSError: a file cannot be read or written.
        """
        from rich.console import Console

        from pianomime.commands.progress import bars
        from pianomime.files import staged
        from pianomime.report import FILES, write_report

        player, score, name = self._cast()
        out = self.out or Path("out", name)
        notes: list[str] = []
        with staged(out, FILES) as folder, bars() as tell:
            row = write_report(
                player.play(score, tell), folder, self.video, progress=tell, note=notes.append
            )
        Console().print(_table(row))
        for note in notes:
            print(note)
        print(f"look and listen: {out / 'report.html'}")

    def _cast(self) -> tuple[Player, Score, str]:
        """Who plays what, and the name of its file."""
        from pianomime.music import Score
        from pianomime.music.excerpt import excerpt
        from pianomime.players.player import DEMONSTRATION_PLAYERS, PLAYERS, Player
        from pianomime.songs.find import find_song

        known = {*PLAYERS, *DEMONSTRATION_PLAYERS}
        if self.player is not None and self.player not in known and Path(self.player).is_dir():
            return self._cast_expert(Path(self.player))
        if Path(self.song).suffix == ".npz":
            from pianomime.plan.demonstration import Demonstration

            shown = Demonstration.load(self.song).excerpt(self.start, self.seconds)
            if self.player in PLAYERS:
                player = Player.from_name(self.player, self.effort)
            else:
                player = Player.from_demonstration(shown, self.player or "", self.effort)
            return player, shown.score, Path(self.song).stem
        player = Player.from_name(self.player or "zero-shot", self.effort)
        midi = find_song(self.song)
        score = excerpt(Score.from_midi(midi), self.start, self.seconds)
        return player, score, midi.stem

    def _cast_expert(self, folder: Path) -> tuple[Player, Score, str]:
        """The expert of a run; it plays the excerpt that it was trained on."""
        from pianomime.commands.extras import extra
        from pianomime.errors import InputError

        for name in ("start", "seconds", "effort"):
            if getattr(self, name) != getattr(Play, name):
                raise InputError(f"--{name}: an expert plays what it was trained on, as it does")
        with extra("train"):
            from pianomime.learn.envs.reference import load_score
            from pianomime.learn.expert.expert import load_expert

            player, run = load_expert(folder)
            score = load_score(self.song, run.start, run.seconds)
        return player, score, Path(self.song).stem


def _table(row: Row) -> Table:
    from rich.table import Table

    table = Table(title=str(row["song"]), title_style="bold", show_header=False)
    for label, text in (
        ("F1", f"{row['f1']:.3f}"),
        ("precision, recall", f"{row['precision']:.3f}, {row['recall']:.3f}"),
        ("onset F1, pedal F1", f"{row['onset_f1']:.3f}, {row['pedal_f1']:.3f}"),
        ("notes (left out)", f"{row['notes']} ({row['dropped_notes']})"),
        ("physics broke", f"{row['blow_ups']} times"),
        (
            "planned, simulated",
            f"{row['plan_seconds']:.1f} s, {row['simulate_seconds']:.1f} s "
            f"for {row['song_seconds']:.1f} s of music",
        ),
    ):
        table.add_row(label, text)
    return table
