"""`pianomime train-expert`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from pianomime.commands.extras import extra
from pianomime.commands.named import option_value
from pianomime.file_names import file_name
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.learn.expert.config import ExpertConfig, preset_config
from pianomime.shown import command_word, shown

PresetName = Literal["paper", "best"]


@dataclass(frozen=True)
class TrainExpert:
    """Train an expert of one song, on a human's demonstration or on the zero-shot plan.

    RUN then holds the expert, its learning curve (curve.json, tensorboard/) and the checkpoint.
    Started again with the same RUN, an interrupted run resumes from its checkpoint, and a finished
    one goes on if --total-steps is larger.

    Examples:
      pianomime train-expert DEMO.npz
      pianomime train-expert SONG.mid --preset best -o runs/song
      pianomime train-expert DEMO.npz --total-steps 5000000 --ppo.learning-rate 1e-4
      pianomime play SONG.mid --player runs/song
    """

    song: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SONG")]
    """A demonstration (see `pianomime retarget`), a MIDI file, or the name of a bundled song."""
    preset: PresetName = "paper"
    """The paper's residual policy, or the trajectory search, which plays best; the settings below
    change it."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="RUN", help_behavior_hint="")
    ] = None
    """Folder of the run; out/expert-SONG-PRESET if not given."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = EXCERPT_SECONDS
    """Longest excerpt, from the first note that sounds at START or after it [s]."""
    start: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0
    """Where in the song to begin [s]."""
    config: Annotated[ExpertConfig, tyro.conf.arg(name="")] = field(default_factory=ExpertConfig)
    """All other settings."""

    @classmethod
    def default(cls, arguments: list[str]) -> TrainExpert:
        """The defaults, which depend on the preset."""
        return cls(
            song=tyro.MISSING, config=preset_config(option_value("--preset", arguments, "paper"))
        )

    def run(self) -> None:
        """Train.

        Raises:
            InputError: the song, the folder or the device cannot be used.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.needs import need_folder, need_packages, need_piece
        from pianomime.commands.progress import bars
        from pianomime.world.device_batch import check_device

        out = self.out or Path("out", f"expert-{file_name(Path(self.song).stem)}-{self.preset}")
        need_packages("train")
        need_piece(self.song)
        need_folder(out)
        check_device(self.config.env.device)
        with extra("train"), bars() as progress:
            progress("loading", 0, 0)
            from pianomime.learn.expert.expert import train_expert

            run = train_expert(
                self.song, out, self.config, self.start, self.seconds, progress=progress
            )
        best = run.best()[1]
        print(f"F1 {best['f1']:.3f} after {best['steps']} steps")
        print(f"saved: {shown(out)}")
        print(f"play it: pianomime play {command_word(self.song)} --player {command_word(out)}")
