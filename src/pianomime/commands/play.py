"""`pianomime play`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from pianomime.commands.report import make_report
from pianomime.keyboard import EXCERPT_SECONDS, LEAD_IN_SECONDS
from pianomime.world_names import WorldName

if TYPE_CHECKING:
    from pianomime.music import Score
    from pianomime.players import Player
    from pianomime.players.casting import Casting


@dataclass(frozen=True)
class Play:
    """Play a song with two simulated hands, and report on it.

    OUT then holds a page to look at and listen to (report.html), the metrics (report.json), the
    performance as arrays (performance.npz), and MIDI, WAV and pictures of it.

    Settings of the player are options too, such as --planner.beam 200: `pianomime players
    zero-shot` lists those of the zero-shot player.

    Players:
      planned: zero-shot, zero-shot-20hz, zero-shot-ik, fingers
      learned: three-stage, two-stage-diff, two-stage-diff-no-sdf,
        two-stage-diff-res, two-stage-bet, two-stage-mse, one-stage-diff,
        bc-mse, multi-task-sac
      of DEMO.npz: demonstration, demonstration-ik
      of one song: the folder of an expert
      `pianomime players` says what each is and needs.

    Examples:
      pianomime play ode-to-joy
      pianomime play SONG.mid -o out/song --video
      pianomime play SONG.mp3
      pianomime play SONG.mid --effort 3
      pianomime play SONG.mid --start 60 --seconds 180
      pianomime play SONG.mid --lead-in 0
      pianomime play SONG.mid --world solid
      pianomime play DEMO.npz --player demonstration-ik
      pianomime play SONG.mid --player RUN
      pianomime play SONG.mid --player my_module:make_player --seed 1
      pianomime play SONG.mid --effort 0 --planner.beam 200
    """

    song: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SONG")]
    """A MIDI file, a demonstration (see `pianomime retarget`), a recording of a piano or a film of
    falling notes, which are transcribed first (see `pianomime transcribe`), or the name of a
    bundled song (see `pianomime songs`)."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT", help_behavior_hint="")
    ] = None
    """Folder for the report; out/NAME if not given."""
    player: Annotated[str | None, tyro.conf.arg(metavar="PLAYER", help_behavior_hint="")] = None
    """Who plays: a name (see `pianomime players`), PACKAGE.MODULE:FACTORY, the folder of an expert
    (see `pianomime train-expert`) or of weights (see `pianomime train`). zero-shot if not given,
    and for demonstrations, demonstration."""
    effort: Annotated[int, tyro.conf.arg(metavar="0..3")] = 1
    """How hard to try: 0 plays in one pass; 1 to 3 try variations where notes would go wrong, and
    zero-shot rehearses first. On two cores 1 takes about as long as the music or less, 2 and 3
    several times longer. For generalists it is 2, 5, 20 or 100 steps of the diffusion."""
    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Seed of everything that is random."""
    world: Annotated[WorldName | None, tyro.conf.arg(help_behavior_hint="")] = None
    """World in which it plays: paper, where hands pass through each other, or solid, where they
    collide and what moves them has limits. The player's own if not given."""
    settings: tyro.conf.Suppress[dict[str, Any]] = field(default_factory=dict)
    """Settings of the player, such as `--planner.beam 200`; `pianomime players` lists them."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = EXCERPT_SECONDS
    """How much to play at most, from what sounds at START or first after it [s]."""
    start: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0
    """Where in the song to begin [s]."""
    lead_in: Annotated[float | None, tyro.conf.arg(metavar="S", help_behavior_hint="")] = None
    """Silence before the first sound, in which the hands get to their keys [s]; it is no part of
    --seconds. 0.5 if not given, and 0 for experts and plans of demonstrations, which have none."""
    video: bool = False
    """Render a film of 60 pictures a second too, where this machine can."""

    def run(self) -> None:
        """Play and write the report.

        Raises:
            InputError: there is nothing to play, or no such player.
            OSError: a file cannot be read or written.
        """
        from pianomime.file_names import file_name
        from pianomime.songs.find import find_recording, find_song

        recording = find_recording(self.song)
        path = recording or find_song(self.song)
        casting = self._casting(path)
        out = self.out or Path("out", file_name(path.stem))
        if recording is not None:
            # Before the long work.
            casting.check_kind(path)
            path = self._transcribed(recording, out)
        player, score = self._cast(casting, path)
        make_report(lambda progress: player.play(score, progress), out, self.video)

    def _casting(self, path: Path) -> Casting:
        """Who plays, before the file is read."""
        from pianomime.players.casting import Casting

        name = self.player or ("demonstration" if path.suffix == ".npz" else "zero-shot")
        return Casting.of(name, self.effort, self.seed, self.world, **self.settings)

    def _transcribed(self, recording: Path, out: Path) -> Path:
        """The transcription of what is played of a recording, beside the report."""
        from pianomime.commands.transcribe import write_transcription
        from pianomime.file_names import file_name
        from pianomime.video.recording_notes import RecordingConfig

        midi = out / f"{file_name(recording.stem)}-transcribed.mid"
        config = RecordingConfig(start=self.start, seconds=self.seconds)
        write_transcription(recording, midi, config)
        return midi

    def _cast(self, casting: Casting, path: Path) -> tuple[Player, Score]:
        """Who plays what."""
        from pianomime.errors import InputError

        lead_in = self.lead_in
        if lead_in is None:
            lead_in = LEAD_IN_SECONDS if casting.takes_lead_in else 0.0
        player, score = casting.cast(path, self.start, self.seconds, lead_in)
        if player.excerpt is not None:
            start, seconds = player.excerpt
            trained = {"start": start, "seconds": seconds, "effort": player.effort}
            for option, value in trained.items():
                given, default = getattr(self, option), getattr(Play, option)
                if given not in (default, value):
                    raise InputError(
                        f"--{option} {given:g}: {casting.source} plays the excerpt that it was "
                        f"trained on, as it does: --{option} {value:g}"
                    )
        return player, score
