"""`pianomime train`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.commands.named import named
from pianomime.errors import InputError
from pianomime.learn.imitation.config import POLICIES, PolicyConfig, PolicyName, Size, policy_config


@dataclass(frozen=True)
class Train:
    """Train one network of a player that plays every song, by imitation.

    A player of two stages needs two, and those that see goals by their codes need a goal encoder
    first (`pianomime train-goal`). OUT then holds STAGE.onnx, and in the folder STAGE the training.
    Started again it goes on where it was. Set PIANOMIME_WEIGHTS=OUT to play with what is in OUT.

    Examples:
      pianomime train high-diff --experts lessons.zarr
      pianomime train low-diff --experts lessons.zarr
      pianomime train low-diff-res --experts lessons.zarr more.zarr --fit.steps 50000
      pianomime train high-diff --size paper --demonstrations demos -o out/paper
    """

    stage: Annotated[tyro.conf.Positional[PolicyName], tyro.conf.arg(metavar="STAGE")]
    """Which network."""
    demonstrations: Annotated[Path | None, tyro.conf.arg(metavar="DATA")] = None
    """What high levels learn from instead: a folder of demonstrations, or published ones (.npz)."""
    experts: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="DATA...")] = ()
    """Data sets made by `pianomime collect-dagger` or `pianomime collect`."""
    goal: Annotated[Path | None, tyro.conf.arg(metavar="FOLDER")] = None
    """The goal encoder; OUT/goal if not given."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/generalist")
    """Folder for the results, shared by all stages."""
    size: Size = "small"
    """Of the network: one for two cores, or the paper's for a GPU; settings below change it."""
    config: Annotated[PolicyConfig, tyro.conf.arg(name="")] = field(
        default_factory=lambda: policy_config("high-diff")
    )
    """Everything else."""

    @classmethod
    def default(cls, arguments: list[str]) -> Train:
        """What holds for arguments that are not given: that is for stage and size to say."""
        # Not what an option is given, such as a folder of that name.
        after = zip(["", *arguments], arguments, strict=False)
        alone = {argument for before, argument in after if not before.startswith("-")}
        stage = next((name for name in POLICIES if name in alone), POLICIES[0])
        # Any other is refused when the command line is parsed.
        size: Size = "paper" if named("--size", arguments, "small") == "paper" else "small"
        return cls(stage=tyro.MISSING, config=policy_config(stage, size))

    def run(self) -> None:
        """Train.

        Raises:
            InputError: data are missing or cannot be used, or OUT holds another training.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.progress import bars

        if _kind(self.config) != _kind(policy_config(self.stage)):
            raise InputError(f"name the stage first: pianomime train {self.stage} ...")
        with extra("train"), bars() as tell:
            from pianomime.learn.imitation.training import train_policy

            made = train_policy(
                self.stage,
                self.config,
                self.out,
                self.demonstrations,
                self.experts,
                self.goal or self.out / "goal",
                lambda done, total, remark: tell(self.stage, done, total, remark),
            )
        print(f"saved: {made}")


def _kind(config: PolicyConfig) -> tuple[str, str, str, bool]:
    """What a stage's name stands for: defaults are taken by it, before arguments are parsed."""
    return config.level, config.network, config.code, config.prior
