"""`pianomime players`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from pianomime.world_names import PAPER, WorldName

_ABOUT = {
    "zero-shot": "plays notes in time, with touch",
    "zero-shot-20hz": "plays frames, as in the paper",
    "zero-shot-ik": "the same, the paper's tracker",
    "fingers": "zero-shot-20hz and a residual",
    "three-stage": "fingers, fingertips, controls",
    "two-stage-diff": "diffusion policies, two levels",
    "two-stage-diff-no-sdf": "the same, without a goal encoder",
    "two-stage-diff-res": "the same, on the paper's tracker",
    "two-stage-bet": "behavior transformers",
    "two-stage-mse": "diffusion, then regression",
    "one-stage-diff": "diffusion, goals to controls",
    "bc-mse": "regression, goals to controls",
    "multi-task-sac": "reinforcement learning (SAC)",
    "demonstration": "a human's fingers, made feasible",
    "demonstration-ik": "as recorded, the paper's tracker",
    "expert": "plays the song it was trained on",
}
"""What the players are that come with the program."""

_INPUTS = {"demonstration": "DEMO.npz", "demonstration-ik": "DEMO.npz", "expert": "RUN"}
"""What the user gives them: in place of a song, or as --player."""


@dataclass(frozen=True)
class Players:
    """List the players and what each needs, or the settings of one.

    Players of other packages are listed too. The extra is what must be installed (`pip install`
    with its name in brackets); further needs are trained weights, a demonstration (`pianomime
    retarget`) instead of a song, or the run of an expert (`pianomime train-expert`) as --player.
    The last column says whether a player can be used now; below are the commands that help if not.

    A setting is an option of `pianomime play` and `pianomime evaluate`; its value is shown as it is
    at the default effort, in the world that is named.

    Examples:
      pianomime players
      pianomime players zero-shot
      pianomime players zero-shot --world solid
      pianomime play SONG.mid --planner.beam 200 --tracker.force 6
    """

    player: Annotated[
        tyro.conf.Positional[str], tyro.conf.arg(metavar="[PLAYER]", help_behavior_hint="")
    ] = ""
    """Whose settings to list."""
    world: WorldName = PAPER
    """The world in which it is to play."""

    def run(self) -> None:
        """Print the table, or one setting a line, with the value that it has by default.

        Raises:
            InputError: there is no such player.
        """
        import json

        from pianomime.players.registry import player_settings

        if not self.player:
            _print_all()
            return
        settings = player_settings(self.player, self.world)
        for name, value in settings.items():
            print(f"--{name.replace('_', '-')} {json.dumps(value)}")
        if not settings:
            print(f"{self.player} has no settings")


def _print_all() -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from pianomime.players.registry import EXPERT, player_names
    from pianomime.policies.methods import METHODS, WEIGHTS
    from pianomime.shown import shown

    missing = {name: _missing(name) for name in player_names()}
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("player")
    for label in ("what it is", "extra", "needs", "now"):
        table.add_column(label)
    for name, lacks in missing.items():
        learned = name in METHODS
        extra = "learned" if learned else "train" if name == EXPERT else ""
        needs = "weights" if learned else _INPUTS.get(name, "")
        about = _ABOUT.get(name, "comes with another package")
        # Text, not str, in which rich would look for markup.
        table.add_row(*map(Text, (shown(name), about, extra, needs, "no" if lacks else "yes")))
    Console().print(table)
    if any(missing.values()):
        print(f"\nto use the others (a folder of weights can also be named in {WEIGHTS}):")
    for name, lacks in missing.items():
        for each in lacks:
            print(f"  {shown(name)}: {shown(each)}")


def _missing(name: str) -> list[str]:
    """The commands that make what a player lacks, or why it cannot be loaded; none if it can."""
    from pianomime.commands.needs import need_packages
    from pianomime.errors import InputError
    from pianomime.players.registry import EXPERT, player_files
    from pianomime.policies.methods import METHODS, missing_policies, train_command

    try:
        if name in METHODS:
            need_packages("learned", ("onnxruntime",))
            return [train_command(policy) for policy in missing_policies(name)]
        if name == EXPERT:
            need_packages("train")
        player_files(name)
    except (InputError, OSError) as error:
        return [str(error)]
    return []
