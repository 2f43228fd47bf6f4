"""`pianomime collect-dagger`."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import tyro

from pianomime.learn.data.dagger_config import DaggerConfig
from pianomime.shown import shown

if TYPE_CHECKING:
    from pianomime.learn.data.episode import Episode
    from pianomime.progress import Progress


_Item = TypeVar("_Item")


@dataclass(frozen=True)
class CollectDagger:
    r"""Make a data set for imitation by DAgger, with the dynamic tracker as the expert.

    Demonstrations are played with noise on the controls, and every state is labelled with the
    expert's control, so that policies also learn to recover. The expert itself plays, or a
    low-level policy that was trained before (--rollout-policy), which is DAgger proper (Ross et
    al., 2011). The fingertips are the human's, or those that a high-level policy predicts
    (--fingertip-policy); then DEMOS can also be MIDI files. OUT is a data set in the form of
    `pianomime collect`.

    Examples:
      pianomime collect-dagger demonstrations.npz -o dagger.zarr
      pianomime train high-diff --experts dagger.zarr
      pianomime train low-diff --experts dagger.zarr -o first --goal GOAL
      pianomime collect-dagger demonstrations.npz -o more.zarr \
        --rollout-policy first/low-diff.onnx \
        --fingertip-policy out/generalist/high-diff.onnx
      pianomime collect-dagger MIDI_FOLDER -o songs.zarr \
        --fingertip-policy out/generalist/high-diff.onnx
      pianomime collect-dagger demonstrations.npz -o dagger.zarr \
        --device cuda --worlds 64
      pianomime train low-diff --experts dagger.zarr more.zarr songs.zarr
    """

    demonstrations: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DEMOS")]
    """A demonstration (.npz), a folder of such, or an .npz file of PianoMime's published ones; with
    --fingertip-policy also a MIDI file, or a folder of such."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/dagger.zarr")
    """The data set; an existing one is replaced."""
    jobs: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Processes, each of which plays one demonstration, or --worlds of them side by side; one a
    core if not given."""
    config: Annotated[DaggerConfig, tyro.conf.arg(name="")] = field(default_factory=DaggerConfig)
    """Policies that play, the noise, and what steps the worlds."""

    def run(self) -> None:
        """Collect, and print how well the demonstrations were played.

        Raises:
            InputError: demonstrations, a policy or the device cannot be used.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.progress import bars
        from pianomime.validation import within

        if self.jobs is not None:
            within("jobs", self.jobs, 1)
        songs = self._songs()
        self._check_needs(songs)
        f1: list[float] = []
        with extra("train"), bars() as progress:
            progress("loading", 0, 0)
            from pianomime.learn.data.trajectories import write_trajectories

            # Closed at once where the work is stopped, and with it the processes.
            with closing(self._episodes(songs, progress, f1)) as episodes:
                number = write_trajectories(self.out, episodes)
        print(f"played: {number}, at a mean F1 of {sum(f1) / number:.3f}")
        print(f"saved: {shown(self.out)}")

    def _check_needs(self, songs: list[Path]) -> None:
        from pianomime.commands.needs import (
            need_demonstrations,
            need_packages,
            need_place_for_data_set,
        )

        need_packages("train")
        if not songs:
            need_demonstrations(self.demonstrations)
        need_place_for_data_set(self.out)
        if self.config != DaggerConfig():
            from pianomime.learn.data.dagger import check_config

            check_config(self.config)

    def _songs(self) -> list[Path]:
        """The MIDI files whose fingertips are to be predicted; none if there are demonstrations."""
        from pianomime.commands.needs import demonstration_files
        from pianomime.errors import InputError
        from pianomime.songs.find import MIDI_SUFFIXES, files_below

        source, songs = self.demonstrations, list[Path]()
        if source.is_dir() and not demonstration_files(source):
            with suppress(InputError):
                songs = files_below(source, MIDI_SUFFIXES, "MIDI files")
        elif source.suffix.lower() in MIDI_SUFFIXES and source.is_file():
            songs = [source]
        if not songs:
            return []
        if self.config.fingertip_policy is None:
            raise InputError(
                f"{source}: MIDI files have no fingertips; name a policy that predicts them with "
                "--fingertip-policy"
            )
        return self._some(songs)

    def _some(self, all_of_them: list[_Item]) -> list[_Item]:
        """As many as are wanted, evenly spread."""
        number = len(all_of_them)
        limit = min(self.config.max_demonstrations or number, number)
        return [all_of_them[each * number // limit] for each in range(limit)]

    def _episodes(
        self, songs: list[Path], progress: Progress, f1: list[float]
    ) -> Generator[Episode, None, None]:
        from pianomime.learn.data.dagger import collect_dagger, songs_without_plan
        from pianomime.learn.data.dataset import read_demonstrations

        if songs:
            demonstrations = songs_without_plan(songs)
        else:
            demonstrations = self._some(read_demonstrations(self.demonstrations))
        with closing(collect_dagger(demonstrations, self.config, self.jobs)) as episodes:
            progress("playing", 0, len(demonstrations))
            for done, episode in enumerate(episodes, 1):
                f1.append(episode.f1)
                yield episode
                progress("playing", done, len(demonstrations))
