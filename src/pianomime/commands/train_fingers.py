"""`pianomime train-fingers`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.learn.fingers.config import VALIDATION_SONGS, FingersConfig
from pianomime.shown import shown


@dataclass(frozen=True)
class TrainFingers:
    """Train the finger residual, which all fingers add to zero-shot-20hz, by PPO.

    Many songs are played side by side, on the zero-shot plan and the dynamic tracker. All fingers
    share one policy, and each is rewarded for its own keys. Some songs are kept for validation. OUT
    then holds fingers.onnx, and the folder fingers the training. The same command again resumes a
    training that was stopped. Set PIANOMIME_WEIGHTS=OUT to play with the policy.

    Examples:
      pianomime train-fingers MIDI_FOLDER
      pianomime train-fingers FOLDER FOLDER --total-steps 1000000
      PIANOMIME_WEIGHTS=out/generalist pianomime play SONG.mid --player fingers
    """

    folders: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="FOLDER...", help_behavior_hint="(required)"),
    ]
    """Folders of MIDI files, searched recursively."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/generalist")
    """Folder for the result."""
    threads: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Threads of the physics and of the network; 0 for one a core."""
    config: Annotated[FingersConfig, tyro.conf.arg(name="")] = field(default_factory=FingersConfig)
    """Settings of the training."""

    def run(self) -> None:
        """Train, and print the F1 on the validation songs.

        Raises:
            InputError: there are too few songs, or OUT holds another training.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.needs import need_folder, need_packages, need_songs
        from pianomime.commands.progress import bars

        need_packages("train")
        need_songs(self.folders, VALIDATION_SONGS + 1)
        need_folder(self.out)
        with extra("train"), bars() as progress:
            progress("loading", 0, 0)
            from pianomime.learn.fingers.training import train_fingers

            file, metrics = train_fingers(
                self.folders, self.out, self.config, self.threads, progress
            )
        print(
            f"F1 on validation songs: {metrics['validation/f1']:.4f}, "
            f"without the residual {metrics['validation/f1_base']:.4f}"
        )
        print(f"saved: {shown(file)}")
