"""`pianomime train-experts`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.commands.extras import extra
from pianomime.commands.named import option_value
from pianomime.commands.train_expert import PresetName
from pianomime.errors import InputError
from pianomime.file_names import file_name
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.learn.expert.config import ExpertConfig, preset_config
from pianomime.shown import shown


@dataclass(frozen=True)
class TrainExperts:
    """Train an expert of every demonstration and MIDI file in a folder; print a Markdown table.

    OUT then holds a run for each song, the table (experts.md, experts.json) and a bar chart of the
    F1 (experts.png). Started again with the same OUT, interrupted runs resume and finished ones are
    kept. A song that fails is a line of the table; if all fail, the exit code is 1.

    Examples:
      pianomime train-experts FOLDER
      pianomime train-experts FOLDER --preset best -o out/experts --jobs 4
      pianomime train-experts FOLDER --ray auto
    """

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="FOLDER")]
    """Folder of songs, which is searched with all folders below it."""
    preset: PresetName = "paper"
    """The paper's residual policy, or the trajectory search, which plays best; the settings below
    change it."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT", help_behavior_hint="")
    ] = None
    """Folder for the results; out/experts-FOLDER-PRESET if not given."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = EXCERPT_SECONDS
    """Longest excerpt of each song [s]."""
    start: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0
    """Where in each song to begin [s]."""
    jobs: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Songs that are trained at the same time; one for each core if not given. A Ray cluster
    decides by itself."""
    ray: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS", help_behavior_hint="")] = None
    """Address of a Ray cluster to train on, all of whose nodes see FOLDER and OUT; `auto` for the
    cluster that this machine is part of, `local` for a new one on this machine."""
    config: Annotated[ExpertConfig, tyro.conf.arg(name="")] = field(default_factory=ExpertConfig)
    """All other settings."""

    @classmethod
    def default(cls, arguments: list[str]) -> TrainExperts:
        """The defaults, which depend on the preset."""
        return cls(
            folder=tyro.MISSING, config=preset_config(option_value("--preset", arguments, "paper"))
        )

    def run(self) -> None:
        """Train and print.

        Raises:
            InputError: there are no songs, or the folder, the device or the cluster cannot be used.
            WorkFailed: no expert could be trained, or the disk is full.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.needs import RAY, need_folder, need_packages
        from pianomime.commands.progress import bars
        from pianomime.validation import within
        from pianomime.world.device_batch import check_device

        if self.jobs is not None:
            within("jobs", self.jobs, 1)
        # `.` and `..` have no name of their own.
        out = self.out or Path(
            "out", f"experts-{file_name(self.folder.resolve().name)}-{self.preset}"
        )
        need_packages("train")
        if self.ray is not None:
            need_packages("scale", RAY)
        if not self.folder.is_dir():
            raise InputError(f"{self.folder}: is not a folder; one song: `pianomime train-expert`")
        need_folder(out)
        check_device(self.config.env.device)
        with extra("train" if self.ray is None else "scale"), bars() as progress:
            progress("loading", 0, 0)
            from pianomime.learn.expert.many import experts_table, train_experts

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
        print(f"saved: {shown(out / 'experts.json')}")
