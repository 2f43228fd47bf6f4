"""`pianomime train-goal`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.learn.goal.config import GoalConfig
from pianomime.shown import shown


@dataclass(frozen=True)
class TrainGoal:
    """Train the goal autoencoder: the keys that should be down as a code of 16 numbers.

    Goals that are close on the keyboard get similar codes, which most policies of `pianomime train`
    observe instead of the keys. Some of the files are kept for validation. OUT/codes.png shows the
    codes. The same command again resumes a training that was stopped.

    Examples:
      pianomime train-goal MIDI_FOLDER
      pianomime train-goal FOLDER FOLDER -o goal --trainer.steps 20000
    """

    folders: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="FOLDER...", help_behavior_hint="(required)"),
    ]
    """Folders of MIDI files, searched recursively."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/generalist/goal")
    """Folder for the result."""
    config: Annotated[GoalConfig, tyro.conf.arg(name="")] = field(default_factory=GoalConfig)
    """Settings of the training."""

    def run(self) -> None:
        """Train, and print the metrics.

        Raises:
            InputError: there are no goals, or OUT holds another training.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.needs import need_folder, need_packages, need_songs
        from pianomime.commands.progress import bars

        need_packages("train")
        need_songs(self.folders, 2)
        need_folder(self.out)
        with extra("train"), bars() as progress:
            progress("loading", 0, 0)
            from pianomime.learn.goal.training import train_goal

            metrics, goals = train_goal(self.folders, self.out, self.config, progress)
        print(
            f"trained on {len(goals.train)} goals of {goals.files} files, validated on "
            f"{len(goals.validation)} of {goals.validation_files} others "
            f"({goals.skipped} not readable)"
        )
        print(f"mean error of the decoded distance to the nearest key: {metrics.error_mm:.1f} mm")
        print(
            "rank correlation of distances between codes and between goals: "
            f"{metrics.code_correlation:.3f} "
            f"(between keys and between goals: {metrics.key_correlation:.3f})"
        )
        print(f"saved: {shown(self.out)}")
