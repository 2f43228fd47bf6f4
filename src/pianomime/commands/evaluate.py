"""`pianomime evaluate`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.world_names import WorldName


@dataclass(frozen=True)
class Evaluate:
    """Play and score many songs in parallel; print a Markdown table.

    OUT then holds results.json, results.md, and in songs/ the performance of each song, for
    `pianomime report` and `pianomime diagnose`: some 1 MB for a minute of music. It may be deleted:
    the song is not played again for it. An evaluation that was interrupted resumes where it was
    when it is started again with the same OUT. A song that fails is a line of the table; if all
    fail, the exit code is 1.

    Settings of the player are options too, such as --planner.beam 200: `pianomime players
    zero-shot` lists those of the zero-shot player.

    Players:
      planned: zero-shot, zero-shot-20hz, zero-shot-ik, fingers
      learned: three-stage, two-stage-diff, two-stage-diff-no-sdf,
        two-stage-diff-res, two-stage-bet, two-stage-mse, one-stage-diff,
        bc-mse, multi-task-sac
      of DEMO.npz: demonstration, demonstration-ik
      `pianomime players` says what each is and needs.

    Examples:
      pianomime evaluate FOLDER
      pianomime evaluate FOLDER more/SONG.mid fur-elise -o out/all --jobs 4
      pianomime evaluate FOLDER --player zero-shot-ik --seconds 60
      pianomime evaluate FOLDER --lead-in 0.5
      pianomime evaluate FOLDER --world solid
      pianomime evaluate FOLDER --ray HOST:6379 -o /shared/all
      pianomime evaluate FOLDER --lead-in 0.5 --robust
      pianomime evaluate DEMO.npz DEMOS/*.npz --player demonstration
      pianomime evaluate FOLDER --player my_module:make_player --planner.beam 200
    """

    paths: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        tyro.conf.arg(metavar="PATH...", help_behavior_hint="(required)"),
    ]
    """MIDI files, folders of them, demonstrations (see `pianomime retarget`), or names of bundled
    songs. The players demonstration and demonstration-ik play demonstrations by their own plan, all
    others their notes."""
    player: Annotated[str, tyro.conf.arg(metavar="PLAYER")] = "zero-shot"
    """Who plays: a name (see `pianomime players`), PACKAGE.MODULE:FACTORY, the folder of an expert
    (see `pianomime train-expert`) or of weights (see `pianomime train`)."""
    effort: Annotated[int, tyro.conf.arg(metavar="0..3")] = 1
    """How hard to try: 0 plays in one pass; 1 to 3 try variations where notes would go wrong, and
    zero-shot rehearses first. On two cores 1 takes about as long as the music or less, 2 and 3
    several times longer. For generalists it is 2, 5, 20 or 100 steps of the diffusion."""
    world: Annotated[WorldName | None, tyro.conf.arg(help_behavior_hint="")] = None
    """World in which it plays: paper, where hands pass through each other, or solid, where they
    collide and what moves them has limits. The player's own if not given."""
    settings: tyro.conf.Suppress[dict[str, Any]] = field(default_factory=dict)
    """Settings of the player, such as `--planner.beam 200`; `pianomime players` lists them."""
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = EXCERPT_SECONDS
    """How much of each song to play at most, from its first note [s]."""
    lead_in: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0
    """Silence before the first note, in which the hands get to their keys [s]: 0 in the paper's
    protocol; 0.5 as `pianomime play` has it. It is no part of --seconds."""
    jobs: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Songs played at the same time; one a core if not given. They slow each other down: compare
    real time only between runs with the same N."""
    ray: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS", help_behavior_hint="")] = None
    """Address of a Ray cluster to play on, all of whose nodes see the songs and OUT; `auto` for the
    cluster that this machine is part of, `local` for a new one on this machine."""
    seed: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Seed of everything that is random."""
    robust: bool = False
    """Play what was found again in worlds that differ from the one that the player knows, as it is
    and with feedback; OUT then holds robust.md, robust.csv and robust.json as well."""
    out: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], metavar="OUT", help_behavior_hint="")
    ] = None
    """Folder for the results; out/evaluate-PLAYER-EFFORT if not given."""

    def run(self) -> None:
        """Evaluate and print.

        Raises:
            InputError: a path stands for no song, or there is no such player.
            WorkFailed: no song could be played, or OUT cannot be written any more.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.progress import bars
        from pianomime.errors import WorkFailed
        from pianomime.evaluation.evaluation import evaluate
        from pianomime.evaluation.robustness import robust_markdown, robustness
        from pianomime.evaluation.table import markdown
        from pianomime.file_names import file_name
        from pianomime.shown import command_word, shown

        if self.ray is not None:
            # Not before it is needed: it imports what is there of learning.
            from pianomime.commands.needs import RAY, need_packages

            need_packages("scale", RAY)
        seeded = f"-seed{self.seed}" if self.seed else ""
        # A player may be called by a path or a module.
        there = f"-{self.world}" if self.world else ""
        name = f"evaluate-{file_name(self.player)}-{self.effort}{there}{seeded}"
        out = self.out or Path("out", name)
        with bars() as progress:
            results = evaluate(
                self.paths,
                self.player,
                effort=self.effort,
                seed=self.seed,
                world=self.world,
                settings=self.settings,
                seconds=self.seconds,
                lead_in=self.lead_in,
                jobs=self.jobs,
                ray=self.ray,
                out=out,
                progress=progress,
            )
            robust = None
            if self.robust:
                robust = robustness(results, out, jobs=self.jobs, progress=progress)
        print(markdown(results))
        if robust is not None:
            print(robust_markdown(robust))
        print(f"saved: {shown(out / 'results.json')}")
        kept = [row for row in results["songs"] if "performance" in row]
        if kept:
            worst = min(kept, key=lambda row: float(row["music"]["note_f1_50"]))
            path = command_word(out / worst["performance"])
            print(f"hear the lowest note F1, {worst['song']}: pianomime report {path}")
        if all("error" in row for row in results["songs"]):
            first = results["songs"][0]
            raise WorkFailed(f"no song could be played: {first['song']}: {first['error']}")
