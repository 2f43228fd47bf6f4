"""`pianomime train-experts`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.commands.extras import extra
from pianomime.commands.named import named
from pianomime.commands.train_expert import PresetName
from pianomime.learn.expert.config import ExpertConfig, preset_config


@dataclass(frozen=True)
class TrainExperts:
    """Train an expert of every demonstration and MIDI file in a folder; print a Markdown table.

    OUT then holds a run for each song, the table (experts.md, experts.json) and a picture of all
    F1, sorted (experts.png). Started again with the same OUT it goes on where it was. A song that
    fails is a line of the table.

    Examples:
      pianomime train-experts FOLDER
      pianomime train-experts FOLDER --preset best -o out/experts --jobs 4
      pianomime train-experts FOLDER --ray auto
    """

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FOLDER")]
    """Of songs, also further down."""
    preset: PresetName = "paper"
    """The paper's residual policy, or what plays best; settings below change it."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = None
    """Folder for the results; out/experts-FOLDER-PRESET if not given."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = 30.0
    """How much of each song to play at most [s]."""
    start: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0
    """Where in each song to begin [s]."""
    jobs: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Songs at the same time; one a core if not given. A cluster decides for itself."""
    ray: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")] = None
    """A Ray cluster to train on, all of whose nodes see FOLDER and OUT; `auto` for the one that
    this machine is part of, `local` for one on this machine."""
    config: Annotated[ExpertConfig, tyro.conf.arg(name="")] = field(default_factory=ExpertConfig)
    """Everything else."""

    @classmethod
    def default(cls, arguments: list[str]) -> TrainExperts:
        """What holds for arguments that are not given: that is for the preset to say."""
        return cls(folder=tyro.MISSING, config=preset_config(named("--preset", arguments, "paper")))

    def run(self) -> None:
        """Train and print.

        Raises:
            InputError: there are no songs, or the folder or the cluster cannot be used.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.progress import bars

        with extra("train"):
            from pianomime.learn.expert.many import experts_table, train_experts
        out = self.out or Path("out", f"experts-{self.folder.name}-{self.preset}")
        with bars() as progress, extra("train" if self.ray is None else "scale"):
            rows = train_experts(
                self.folder,
                out,
                self.config,
                self.start,
                self.seconds,
                self.jobs,
                self.ray,
                progress,
            )
        print(experts_table(rows))
        print(f"saved: {out / 'experts.json'}")
