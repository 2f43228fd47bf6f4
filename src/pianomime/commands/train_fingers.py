"""`pianomime train-fingers`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.learn.fingers.config import FingersConfig


@dataclass(frozen=True)
class TrainFingers:
    """Train what all ten fingers add to the zero-shot player, by reinforcement learning.

    Many songs are played side by side, each as the zero-shot player would; every finger learns from
    what becomes of its own keys. Some songs are kept to measure on. OUT then holds fingers.onnx,
    and the folder fingers the training. Started again it goes on where it was. Set
    PIANOMIME_WEIGHTS=OUT to play with it.

    Examples:
      pianomime train-fingers MIDI_FOLDER
      pianomime train-fingers FOLDER FOLDER --frames 1000000
      PIANOMIME_WEIGHTS=out/generalist pianomime play SONG.mid --player fingers
    """

    folders: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FOLDER...")]
    """Of MIDI files, also further down."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/generalist")
    """Folder for the result."""
    threads: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Threads of the physics and of the network; one a core if 0."""
    config: Annotated[FingersConfig, tyro.conf.arg(name="")] = field(default_factory=FingersConfig)
    """Everything else."""

    def run(self) -> None:
        """Train and print how good it is.

        Raises:
            InputError: there are too few songs, or OUT holds another training.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.progress import bars

        with extra("train"), bars() as tell:
            from pianomime.learn.fingers.training import train_fingers

            made, measured = train_fingers(
                self.folders,
                self.out,
                self.config,
                self.threads,
                lambda done, total, remark: tell("training", done, total, remark),
                lambda done, total, remark: tell("planning", done, total, remark),
            )
        print(
            f"F1 of songs that it did not learn from: {measured['unseen/f1']:.4f}, "
            f"without it {measured['unseen/f1_without']:.4f}"
        )
        print(f"saved: {made}")
