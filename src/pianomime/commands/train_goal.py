"""`pianomime train-goal`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.learn.goal.config import GoalConfig


@dataclass(frozen=True)
class TrainGoal:
    """Train the goal autoencoder: from the keys that should be down to 16 numbers.

    Goals that are near each other on the keyboard get codes that are near each other, which is what
    most networks of `pianomime train` are told of a goal. Some of the files are kept to measure on.
    Started again with the same OUT it goes on where it was. OUT/codes.png shows the codes.

    Examples:
      pianomime train-goal MIDI_FOLDER
      pianomime train-goal FOLDER FOLDER -o out/generalist/goal --fit.steps 20000
    """

    folders: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FOLDER...")]
    """Of MIDI files, also further down."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/generalist/goal")
    """Folder for the result."""
    config: Annotated[GoalConfig, tyro.conf.arg(name="")] = field(default_factory=GoalConfig)
    """Everything else."""

    def run(self) -> None:
        """Train and print how good it is.

        Raises:
            InputError: there are no goals, or OUT holds another training.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.progress import bars

        with extra("train"), bars() as tell:
            from pianomime.learn.goal.training import train_goal

            figures, goals = train_goal(
                self.folders,
                self.out,
                self.config,
                lambda done, total, remark: tell("training", done, total, remark),
                lambda done, total, remark: tell("reading", done, total, remark),
            )
        print(
            f"{len(goals.train)} goals of {goals.files} files learned, measured on "
            f"{len(goals.unseen)} of {goals.unseen_files} others ({goals.skipped} not readable)"
        )
        print(f"distance to the nearest key: off by {figures.error_mm:.1f} mm")
        print(
            f"near goals, near codes: rank correlation {figures.near_codes:.3f} "
            f"(of the keys themselves: {figures.near_keys:.3f})"
        )
        print(f"saved: {self.out}")
