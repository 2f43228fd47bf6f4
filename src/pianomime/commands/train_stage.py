"""`pianomime train-stage`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.learn.three_stage.config import StageConfig, StageName
from pianomime.shown import shown


@dataclass(frozen=True)
class TrainStage:
    """Train one stage of the player three-stage, by imitation of zero-shot-20hz.

    The first stage says which finger presses each key, the second where the fingertips go, the
    third how the joints get them there. All learn from data sets that `pianomime perform` makes, in
    any order. OUT then holds STAGE.onnx, and the folder STAGE the training, with its curves for
    TensorBoard. The same command again resumes a training that was stopped. Set
    PIANOMIME_WEIGHTS=OUT to play with the stages in OUT.

    Examples:
      pianomime train-stage fingering --experts songs.zarr --dropout 0.1
      pianomime train-stage hand-motion --experts songs.zarr more.zarr
      pianomime train-stage hand-controls --experts songs.zarr
      PIANOMIME_WEIGHTS=out/generalist pianomime play SONG.mid --player three-stage
    """

    stage: Annotated[tyro.conf.Positional[StageName], tyro.conf.arg(metavar="STAGE")]
    """fingering, hand-motion or hand-controls."""
    experts: Annotated[
        tuple[Path, ...], tyro.conf.arg(metavar="DATA...", help_behavior_hint="(required)")
    ]
    """Data sets made by `pianomime perform`. The third stage learns to recover from those with
    noise."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/generalist")
    """Folder for the results, shared by all stages."""
    config: Annotated[StageConfig, tyro.conf.arg(name="")] = field(default_factory=StageConfig)
    """Settings of the network and its training."""

    def run(self) -> None:
        """Train.

        Raises:
            InputError: data are missing or cannot be used, or OUT holds another training.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.needs import need_data_sets, need_folder, need_packages
        from pianomime.commands.progress import bars

        need_packages("train")
        need_data_sets(self.experts)
        need_folder(self.out)
        with extra("train"), bars() as progress:
            progress("loading", 0, 0)
            from pianomime.learn.three_stage.training import train_stage

            file = train_stage(self.stage, self.config, self.out, self.experts, progress)
        print(f"saved: {shown(file)}")
