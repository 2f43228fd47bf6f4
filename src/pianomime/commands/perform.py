"""`pianomime perform`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.shown import command_word, shown
from pianomime.world_names import WorldName

_TOLD = 15
"""Songs that failed whose reason is printed; the data set has all of them."""


@dataclass(frozen=True)
class Perform:
    """Make a data set for imitation of many MIDI files, which a player plays.

    OUT is a data set in the form of `pianomime collect`: state, goal, fingertips, fingering,
    action and key events of every frame, with a card (README.md) that says what it holds. Songs
    that are finished are on disk at once, in OUT.parts: however it was interrupted, the same
    command goes on. With more songs it adds them to the OUT that is there. A song that fails is
    told, and the others go on; the exit code is then 1.

    Examples:
      pianomime perform FOLDER -o songs.zarr
      pianomime perform FOLDER more/SONG.mid fur-elise -o songs.zarr --jobs 4
      pianomime perform FOLDER -o recovering.zarr --noise 0.2
      pianomime perform FOLDER -o /shared/songs.zarr --ray HOST:6379
      pianomime perform HELD_OUT -o songs.zarr --split test
      pianomime train low-mse --experts songs.zarr
    """

    songs: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        tyro.conf.arg(metavar="SONG...", help_behavior_hint="(required)"),
    ]
    """MIDI files, folders of them, or names of bundled songs."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/songs.zarr")
    """The data set; one that was made with the same settings keeps its episodes."""
    player: Annotated[str, tyro.conf.arg(metavar="PLAYER")] = "zero-shot-20hz"
    """Who plays: a name (see `pianomime players`), PACKAGE.MODULE:FACTORY, or the folder of weights
    (see `pianomime train`). It plans fingertips and gives one control a frame."""
    effort: Annotated[int, tyro.conf.arg(metavar="0..3")] = 0
    """How hard to try, as of `pianomime evaluate`."""
    world: Annotated[WorldName | None, tyro.conf.arg(help_behavior_hint="")] = None
    """World in which it plays: paper or solid; the player's own if not given."""
    settings: tyro.conf.Suppress[dict[str, Any]] = field(default_factory=dict)
    """Settings of the player, such as `--planner.beam 200`; `pianomime players` lists them."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = EXCERPT_SECONDS
    """How much of each song to play at most, from its first note [s]; inf for all of it."""
    lead_in: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0
    """Silence before the first note, in which the hands get to their keys [s]."""
    noise: Annotated[float, tyro.conf.arg(metavar="SCALE")] = 0.0
    """Largest standard deviation [rad] of noise on the controls of fingers; each song has a random
    share of it. What is recorded as the action is what the player would do in the states that it
    gets into so, which it must be able to say (`zero-shot-20hz` at effort 0 is)."""
    split: Literal["train", "test"] = "train"
    """Of the songs: those of `test` are never trained on."""
    jobs: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Songs played at the same time; one a core if not given."""
    ray: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS", help_behavior_hint="")] = None
    """Address of a Ray cluster to play on, all of whose nodes see the songs and the folder of OUT;
    `auto` for the cluster that this machine is part of, `local` for a new one on this machine."""
    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Seed of everything that is random."""

    def run(self) -> None:
        """Play, and print what became of the songs.

        Raises:
            InputError: a path stands for no song, the player cannot make a data set, or OUT is
                something else than one of the same settings.
            WorkFailed: a song could not be played, or OUT cannot be written any more.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.needs import RAY, need_packages, need_place_for_data_set
        from pianomime.commands.progress import bars
        from pianomime.errors import WorkFailed
        from pianomime.learn.data.format import training_songs
        from pianomime.validation import within

        if self.jobs is not None:
            within("jobs", self.jobs, 1)
        need_packages("train", ("zarr",))
        if self.ray is not None:
            need_packages("scale", RAY)
        need_place_for_data_set(self.out)
        with extra("train" if self.ray is None else "scale"), bars() as progress:
            progress("loading", 0, 0)
            from pianomime.learn.data.perform import perform

            done = perform(
                self.songs,
                self.out,
                self.player,
                effort=self.effort,
                seed=self.seed,
                world=self.world,
                settings=self.settings,
                seconds=self.seconds,
                lead_in=self.lead_in,
                noise=self.noise,
                split=self.split,
                jobs=self.jobs,
                ray=self.ray,
                progress=progress,
            )
        print(f"songs added: {done.added}")
        print(f"episodes: {done.episodes}, {done.hours:.3g} h, at a mean F1 of {done.f1:.3f}")
        for row in done.failed[:_TOLD]:
            print(f"failed: {row['song']}: {row['error']}")
        for row in done.elsewhere[:_TOLD]:
            print(f"not added: {row['song']}: {row['error']}")
        if len(done.elsewhere) > _TOLD:
            print(f"not added, in all: {len(done.elsewhere)}")
        print(f"saved: {shown(self.out)}")
        # A training keeps some songs for validation, and takes none of the split test.
        if len(training_songs(self.out)) > 1:
            data = command_word(self.out)
            print(f"train a policy of it: pianomime train low-mse --experts {data}")
        if done.failed:
            more = f"{len(done.failed)} songs" if len(done.failed) > 1 else "1 song"
            raise WorkFailed(f"{more} could not be played; all others are in the data set")
