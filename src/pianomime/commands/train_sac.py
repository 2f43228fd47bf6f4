"""`pianomime train-sac`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.learn.sac.config import SacConfig


@dataclass(frozen=True)
class TrainSac:
    """Train one policy for all songs by reinforcement learning, without demonstrations.

    This is the paper's multi-task SAC, a baseline. OUT then holds multi-task-sac.onnx. Set
    PIANOMIME_WEIGHTS=OUT to play with it. Started again it goes on from its last checkpoint, of
    which there is one every 50,000 frames, of up to a GB.

    Examples:
      pianomime train-sac MIDI_FOLDER
      PIANOMIME_WEIGHTS=out/generalist pianomime play SONG.mid --player multi-task-sac
    """

    folders: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FOLDER...")]
    """Of MIDI files, also further down."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/generalist")
    """Folder for the result."""
    threads: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Threads of the physics; one a core if 0."""
    config: Annotated[SacConfig, tyro.conf.arg(name="")] = field(default_factory=SacConfig)
    """Everything else."""

    def run(self) -> None:
        """Train.

        Raises:
            InputError: there are no songs, or OUT holds another training.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.progress import bars

        with extra("train"), bars() as tell:
            from pianomime.learn.sac.training import train_sac

            made = train_sac(
                self.folders,
                self.out,
                self.config,
                self.threads,
                lambda done, total, remark: tell("training", done, total, remark),
            )
        print(f"saved: {made}")
