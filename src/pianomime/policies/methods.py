"""The players that have learned to play every song, and where their weights are."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from pianomime.errors import InputError

if TYPE_CHECKING:
    from pianomime.policies.finger_residual import FingerResidualTracker
    from pianomime.policies.policy_tracker import PolicyTracker
    from pianomime.policies.sampler import Sampler
    from pianomime.policies.two_stage import Generalist

METHODS: dict[str, tuple[str, ...]] = {
    "two-stage-diff": ("high-diff", "low-diff"),
    "two-stage-diff-no-sdf": ("high-diff-no-sdf", "low-diff-no-sdf"),
    "two-stage-diff-res": ("high-diff", "low-diff-res"),
    "two-stage-bet": ("high-bet", "low-bet"),
    "two-stage-mse": ("high-diff", "low-mse"),
    "one-stage-diff": ("one-stage-diff",),
    "bc-mse": ("bc-mse",),
    "multi-task-sac": ("multi-task-sac",),
}
"""The stages of each method: from goals to fingertips and on to controls, or from goals to controls
at once (appendix G)."""

FINGERS = "fingers"
"""The player with one learned residual for every finger; a stage of the same name."""

_TRAINED_BY = {FINGERS: "train-fingers", "multi-task-sac": "train-sac"}
"""The command that makes a stage, where it is not `train`."""

WEIGHTS = "PIANOMIME_WEIGHTS"
"""Name of the environment variable that tells a folder of weights other than those that came with
the program."""

_SAMPLERS = ((2, 0.0), (5, 0.0), (20, 0.0), (100, 1.0))
"""Steps and eta of a `Sampler`, by effort; the last one is the paper's."""


def make_generalist(method: str, effort: int, seed: int = 0) -> Generalist:
    """A player by the name of its method.

    Args:
        method: one of `METHODS`.
        effort: 0 to 3: how many steps a diffusion is run.
        seed: of what it draws.

    Raises:
        InputError: its weights are not there, or cannot be read.
    """
    # Late, for every player's module asks for the names of all.
    from pianomime.policies.policy import load_policy
    from pianomime.policies.sampler import Sampler
    from pianomime.policies.two_stage import Generalist

    *high, low = METHODS[method]
    sampler = Sampler(*_SAMPLERS[effort])
    follower = load_policy_tracker(stage_path(low), sampler, seed, low)
    wanting = load_policy(stage_path(high[0]), sampler, high[0]) if high else None
    return Generalist(follower, wanting, seed)


def make_fingers() -> FingerResidualTracker:
    """The tracker with the learned residual of fingers.

    Raises:
        InputError: its weights are not there, or cannot be read.
    """
    from pianomime.policies.finger_residual import FingerResidualTracker
    from pianomime.policies.policy import load_network

    return FingerResidualTracker(load_network(stage_path(FINGERS), FINGERS)[0])


def weight_files(player: str) -> list[Path]:
    """The files that decide how a player plays; none for players that have learned nothing.

    Raises:
        InputError: one is not there.
    """
    stages = (FINGERS,) if player == FINGERS else METHODS.get(player, ())
    return [stage_path(stage) for stage in stages]


def load_policy_tracker(
    path: Path, sampler: Sampler | None = None, seed: int = 0, stage: str = ""
) -> PolicyTracker:
    """The tracker of a file of a low level, or of a policy of one stage.

    Args:
        path: of the file.
        sampler: how a diffusion is run.
        seed: of what is drawn.
        stage: that the file must hold; any if not given.

    Raises:
        InputError: it is damaged, or holds another stage, or says something else than controls.
    """
    from pianomime.policies.policy import load_policy
    from pianomime.policies.policy_tracker import PolicyTracker

    policy = load_policy(path, sampler, stage)
    if policy.about["level"] not in ("low", "whole"):
        raise InputError(f"{path}: not a stage that says controls")
    return PolicyTracker(policy, seed, policy.about["level"] == "low", policy.about["prior"])


def weights_folder() -> Path:
    """Where weights are looked for."""
    return Path(os.environ.get(WEIGHTS) or Path(__file__).with_name("weights"))


def stage_path(stage: str) -> Path:
    """The file of a stage.

    Raises:
        InputError: it is not there.
    """
    path = weights_folder() / f"{stage}.onnx"
    if not path.is_file():
        command = _TRAINED_BY.get(stage, f"train {stage}")
        raise InputError(
            f"{path} is not there: train it with `pianomime {command}`, or name a folder of "
            f"weights in {WEIGHTS}"
        )
    return path
