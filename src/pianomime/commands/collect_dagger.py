"""`pianomime collect-dagger`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from pianomime.learn.data.dagger_config import DaggerConfig

if TYPE_CHECKING:
    from pianomime.commands.progress import Tell
    from pianomime.learn.data.episode import Episode


@dataclass(frozen=True)
class CollectDagger:
    """Make a data set for imitation by asking a teacher, the dynamic tracker on human fingertips.

    Demonstrations are played with noise on the controls, by the teacher or by a low level that was
    trained before (--pilot), and the teacher's controls in every moment are written down: so who
    learns from them also learns to come back. With --planner a high level that was trained before
    says where fingertips go. OUT is a data set as `pianomime collect` makes it.

    Examples:
      pianomime collect-dagger demonstrations.npz -o lessons.zarr
      pianomime train high-diff --experts lessons.zarr
      pianomime train low-diff --experts lessons.zarr -o first --goal out/generalist/goal
      pianomime collect-dagger demonstrations.npz --pilot first/low-diff.onnx \
        --planner out/generalist/high-diff.onnx -o more.zarr
      pianomime train low-diff --experts lessons.zarr more.zarr
    """

    demonstrations: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DEMOS")]
    """A folder of demonstrations, or an .npz file of PianoMime's published ones."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/lessons.zarr")
    """The data set; one that is there is replaced."""
    jobs: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Demonstrations played at the same time; one a core if not given."""
    config: Annotated[DaggerConfig, tyro.conf.arg(name="")] = field(default_factory=DaggerConfig)
    """Everything else."""

    def run(self) -> None:
        """Teach, and print how well demonstrations were played meanwhile.

        Raises:
            InputError: demonstrations or the pilot cannot be used.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.progress import bars
        from pianomime.learn.runs.validation import within

        if self.jobs is not None:
            within("jobs", self.jobs, 1)
        played: list[float] = []
        with extra("train"), bars() as tell:
            from pianomime.learn.data.trajectories import write_expert_data

            number = write_expert_data(self.out, self._episodes(tell, played))
        mean = sum(played) / number
        print(f"demonstrations played: {number}, at a mean F1 of {mean:.3f}")
        print(f"saved: {self.out}")

    def _episodes(self, tell: Tell, played: list[float]) -> Iterator[Episode]:
        from pianomime.learn.data.clips import read_human
        from pianomime.learn.data.dagger import collect_dagger

        clips = read_human(self.demonstrations)
        if self.config.most:
            clips = clips[:: -(-len(clips) // self.config.most)]
        for done, episode in enumerate(collect_dagger(clips, self.config, self.jobs), 1):
            played.append(episode.f1)
            yield episode
            tell("playing", done, len(clips))
