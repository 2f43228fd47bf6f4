"""`pianomime train`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.commands.named import option_value
from pianomime.errors import InputError
from pianomime.learn.imitation.config import (
    POLICIES,
    PolicyConfig,
    PolicyName,
    Size,
    check_sources,
    policy_config,
)
from pianomime.shown import shown


@dataclass(frozen=True)
class Train:
    r"""Train one policy of a generalist, a player that plays every song, by imitation.

    Two-stage players need a high-level policy, from goals to fingertips, and a low-level one, from
    fingertips to controls. Policies with goal codes need a goal encoder first, see `pianomime
    train-goal`. OUT then holds POLICY.onnx, and the folder POLICY the training, with its curves for
    TensorBoard. The same command again resumes a training that was stopped. Set
    PIANOMIME_WEIGHTS=OUT to play with the policies in OUT.

    Policies:
      from goals to fingertips: high-diff, high-diff-no-sdf, high-bet
      from fingertips to controls: low-diff, low-diff-no-sdf, low-diff-res,
        low-bet, low-mse
      from goals straight to controls: one-stage-diff, bc-mse

    Examples:
      pianomime train high-diff --experts dagger.zarr
      pianomime train low-diff --experts dagger.zarr
      pianomime train low-diff-res --experts A.zarr B.zarr --trainer.steps 50000
      pianomime train low-diff --experts more.zarr --pretrained low-diff.onnx \
        --trainer.learning-rate 3e-4 -o out/tuned
      pianomime train high-diff --size paper --demonstrations demos -o out/paper
    """

    policy: Annotated[tyro.conf.Positional[PolicyName], tyro.conf.arg(metavar="POLICY")]
    """Name of the policy, see above."""
    demonstrations: Annotated[Path | None, tyro.conf.arg(metavar="DATA", help_behavior_hint="")] = (
        None
    )
    """For high levels, instead of --experts: a folder of demonstrations, or an .npz file of
    PianoMime's published ones."""
    experts: Annotated[
        tuple[Path, ...], tyro.conf.arg(metavar="DATA...", help_behavior_hint="")
    ] = ()
    """Data sets made by `pianomime collect-dagger`, `collect` or `perform`."""
    goal: Annotated[Path | None, tyro.conf.arg(metavar="FOLDER", help_behavior_hint="")] = None
    """Folder of the goal encoder; OUT/goal if not given, and that of the pretrained policy where
    there is one."""
    pretrained: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """Policy (.onnx) of the same kind and size that is trained further, instead of random weights:
    fine-tuning, for which a lower --trainer.learning-rate is usual."""
    out: Annotated[Path, tyro.conf.arg(aliases=["-o"], metavar="OUT")] = Path("out/generalist")
    """Folder for the results, shared by all policies."""
    size: Size = "small"
    """Size of the network: for two CPU cores, or the paper's for a GPU; the settings below override
    it."""
    config: Annotated[PolicyConfig, tyro.conf.arg(name="")] = field(
        default_factory=lambda: policy_config("high-diff")
    )
    """Settings of the policy and its training."""

    @classmethod
    def default(cls, arguments: list[str]) -> Train:
        """The defaults of settings, which depend on the policy and the size that are named."""
        # Not the value of an option, such as a folder of that name.
        after = zip(["", *arguments], arguments, strict=False)
        alone = {argument for before, argument in after if not before.startswith("-")}
        policy = next((name for name in POLICIES if name in alone), POLICIES[0])
        # Any other is refused when the command line is parsed.
        size: Size = "paper" if option_value("--size", arguments, "small") == "paper" else "small"
        return cls(policy=tyro.MISSING, config=policy_config(policy, size))

    def run(self) -> None:
        """Train.

        Raises:
            InputError: data are missing or cannot be used, or OUT holds another training.
            OSError: a file cannot be read or written.
        """
        from pianomime.commands.extras import extra
        from pianomime.commands.progress import bars

        if _kind(self.config) != _kind(policy_config(self.policy)):
            raise InputError(f"name the policy first: pianomime train {self.policy} ...")
        goal = self.goal or self.out / "goal"
        self._check_needs(goal)
        with extra("train"), bars() as progress:
            progress("loading", 0, 0)
            from pianomime.learn.imitation.training import train_policy

            file = train_policy(
                self.policy,
                self.config,
                self.out,
                self.demonstrations,
                self.experts,
                goal,
                progress,
                self.pretrained,
            )
        print(f"saved: {shown(file)}")

    def _check_needs(self, goal: Path) -> None:
        from pianomime.commands.needs import (
            need_data_sets,
            need_demonstrations,
            need_folder,
            need_goal_encoder,
            need_packages,
        )

        check_sources(self.policy, self.config, self.demonstrations, self.experts)
        if self.pretrained is not None and self.goal is not None:
            raise InputError(
                "--goal and --pretrained: name one of the two, for a policy's file holds its goal "
                "encoder"
            )
        if self.goal is not None and self.config.goal_encoding != "sdf":
            raise InputError(f"--goal: {self.policy} needs no goal encoder")
        need_packages("train")
        if self.demonstrations is not None:
            need_demonstrations(self.demonstrations)
        if self.experts:
            need_data_sets(self.experts)
        if self.pretrained is None and self.config.goal_encoding == "sdf":
            need_goal_encoder(goal, self.policy)
        need_folder(self.out)


def _kind(config: PolicyConfig) -> tuple[str, str, str, bool]:
    """What a policy's name stands for: it decides the defaults before arguments are parsed."""
    return config.level, config.network, config.goal_encoding, config.residual
