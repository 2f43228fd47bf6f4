"""`pianomime train-sac`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.learn.sac.config import SacConfig
from pianomime.shown import shown


@dataclass(frozen=True)
class TrainSac:
    """Train one policy for all songs by reinforcement learning, without demonstrations.

    This is the paper's multi-task SAC, a baseline, unless --algorithm, --hit or --reach say
    otherwise. OUT then holds multi-task-sac.onnx, and the folder multi-task-sac the training. The
    same command again resumes a training that was stopped, from its last checkpoint; there is one
    every 50,000 control steps, of up to 1 GB. Set PIANOMIME_WEIGHTS=OUT to play with the policy.

    Examples:
      pianomime train-sac MIDI_FOLDER
      pianomime train-sac MIDI_FOLDER --algorithm tqc --hit 0.9 --reach 1
      pianomime play SONG.mid --player out/generalist/multi-task-sac
    """

    folders: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="FOLDER...", help_behavior_hint="(required)"),
    ]
    """Folders of MIDI files, searched recursively."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/generalist")
    """Folder for the result."""
    threads: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Threads of the physics; 0 for one a core."""
    config: Annotated[SacConfig, tyro.conf.arg(name="")] = field(default_factory=SacConfig)
    """Settings of the training."""

    def run(self) -> None:
        """Train.

        Raises:
            InputError: there are no songs, or OUT holds another training.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.needs import need_folder, need_packages, need_songs
        from pianomime.commands.progress import bars

        need_packages("train")
        need_songs(self.folders)
        need_folder(self.out)
        with extra("train"), bars() as progress:
            progress("loading", 0, 0)
            from pianomime.learn.sac.training import train_sac

            file = train_sac(self.folders, self.out, self.config, self.threads, progress)
        print(f"saved: {shown(file)}")
