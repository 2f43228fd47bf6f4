"""`pianomime collect`."""

from __future__ import annotations

import warnings
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from pianomime.errors import InputError
from pianomime.shown import shown

if TYPE_CHECKING:
    from pianomime.learn.data.episode import Episode
    from pianomime.progress import Progress


@dataclass(frozen=True)
class Collect:
    """Make a data set for imitation from what trained experts play.

    OUT is a zarr 3 group of documented arrays: state, goal, fingertips, base control, residual and
    action of every frame, one episode after the other, all played in one world.

    Examples:
      pianomime collect out/experts-FOLDER-best -o experts.zarr
      pianomime collect RUN RUN -o experts.zarr
      pianomime collect experts.npz --demonstrations demos.npz -o experts.zarr
    """

    runs: Annotated[
        tyro.conf.Positional[tuple[Path, ...]],
        tyro.conf.arg(metavar="RUN...", help_behavior_hint="(required)"),
    ]
    """Run folders of experts, folders of such, or .npz files of PianoMime's published experts."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/experts.zarr")
    """The data set; an existing one is replaced."""
    demonstrations: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = (
        None
    )
    """For published experts: the demonstrations that they were trained on, an .npz file."""

    def run(self) -> None:
        """Collect.

        Raises:
            InputError: a run or a file cannot be used, or they are of different worlds.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.progress import bars

        self._check_needs()
        with extra("train"), bars() as progress:
            progress("loading", 0, 0)
            from pianomime.learn.data.trajectories import write_trajectories

            with closing(self._episodes(progress)) as episodes:
                number = write_trajectories(self.out, episodes)
        print(f"saved {number} episodes: {shown(self.out)}")

    def _check_needs(self) -> None:
        from pianomime.commands.needs import (
            need_demonstrations,
            need_experts,
            need_packages,
            need_place_for_data_set,
        )

        if not self.runs:
            raise InputError("no runs to collect: name run folders of experts")
        if self.demonstrations is not None and not any(run.suffix == ".npz" for run in self.runs):
            raise InputError(
                "--demonstrations: runs hold theirs; they are for published experts (.npz) alone"
            )
        need_packages("train")
        need_place_for_data_set(self.out)
        for path in self.runs:
            if path.suffix != ".npz":
                need_experts(path)
            elif self.demonstrations is None:
                raise InputError(f"{path}: needs --demonstrations, what it was trained on")
            else:
                need_demonstrations(path)
                need_demonstrations(self.demonstrations)

    def _episodes(self, progress: Progress) -> Generator[Episode, None, None]:
        from pianomime.learn.data.episode import PhysicsError, play_episode
        from pianomime.learn.data.published import published_episodes
        from pianomime.learn.expert.expert_run import ExpertRun, find_expert_runs

        for path in self.runs:
            if path.suffix == ".npz":
                assert self.demonstrations is not None
                published = published_episodes(path, self.demonstrations)
                for done, (episode, total) in enumerate(published, 1):
                    yield episode
                    progress(path.name, done, total)
                continue
            found = find_expert_runs(path)
            progress("playing", 0, len(found))
            for done, folder in enumerate(found, 1):
                try:
                    episode = play_episode(ExpertRun.load(folder))
                except PhysicsError as error:
                    warnings.warn(f"left out: {folder}: {error}", stacklevel=2)
                else:
                    yield episode
                progress("playing", done, len(found))
