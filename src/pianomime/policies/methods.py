"""The methods that play with learned policies, and where the policies' weights are."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

from pianomime.errors import InputError
from pianomime.policies.finger_residual import FingerResidualTracker
from pianomime.policies.interface import STAGES
from pianomime.policies.network_file import load_network, load_policy
from pianomime.policies.policy_tracker import PolicyTracker
from pianomime.policies.sampler import Sampler
from pianomime.policies.three_stage.controller import Stages
from pianomime.track import DynamicTracker
from pianomime.world_names import PAPER

GENERALISTS: dict[str, tuple[str, ...]] = {
    "two-stage-diff": ("high-diff", "low-diff"),
    "two-stage-diff-no-sdf": ("high-diff-no-sdf", "low-diff-no-sdf"),
    "two-stage-diff-res": ("high-diff", "low-diff-res"),
    "two-stage-bet": ("high-bet", "low-bet"),
    "two-stage-mse": ("high-diff", "low-mse"),
    "one-stage-diff": ("one-stage-diff",),
    "bc-mse": ("bc-mse",),
    "multi-task-sac": ("multi-task-sac",),
}
"""The policies of each generalist: from goals to fingertips and on to controls, or from goals
straight to controls (paper, appendix G)."""

FINGERS = "fingers"
"""The player with the finger residual, and its policy."""

THREE_STAGE = "three-stage"
"""The player that says fingers before it says places."""

METHODS: dict[str, tuple[str, ...]] = {
    FINGERS: (FINGERS,),
    THREE_STAGE: STAGES,
    **GENERALISTS,
}
"""The policies of every learned player."""

WEIGHTS = "PIANOMIME_WEIGHTS"
"""The environment variable that names a folder of weights other than those in the package."""

SAMPLERS = (Sampler(2), Sampler(5), Sampler(20), Sampler(100, eta=1.0))
"""How a diffusion is sampled, by effort; the last one is the paper's."""

_TRAINED_BY = {
    FINGERS: "train-fingers",
    "multi-task-sac": "train-sac",
    **{stage: f"train-stage {stage}" for stage in STAGES},
}
"""The command that trains a policy, where it is not `train POLICY`."""


def load_finger_tracker(
    weights: str | Path | None = None, world: str = PAPER
) -> FingerResidualTracker:
    """The tracker with the finger residual.

    Args:
        weights: folder of the weights; see `weights_folder`.
        world: name of the world in which it moves hands; the policy was trained in the paper's.

    Raises:
        InputError: its weights are not there, or cannot be read.
    """
    policy = load_network(policy_path(FINGERS, weights), FINGERS)[0]
    return FingerResidualTracker(policy, DynamicTracker(world=world))


def load_stages(weights: str | Path | None = None) -> Stages:
    """The policies of the player of three stages.

    Args:
        weights: folder of the weights; see `weights_folder`.

    Raises:
        InputError: some are not there, or cannot be read.
    """
    networks = []
    for path, stage in zip(weight_files(THREE_STAGE, weights), STAGES, strict=True):
        network, info = load_network(path, stage)
        if (info.level, info.network) != (stage, "mlp"):
            raise InputError(f"{path}: not a network of the stage {stage}")
        networks.append(network)
    return Stages(*networks)


def load_policy_tracker(
    path: Path, sampler: Sampler | None = None, seed: int = 0, name: str = ""
) -> PolicyTracker:
    """The tracker of a low-level policy, or of one that goes from goals straight to controls.

    Args:
        path: of the .onnx file.
        sampler: how a diffusion is sampled.
        seed: of the sampling.
        name: of the policy that the file must hold; any if not given.

    Raises:
        InputError: it is damaged, or holds another policy, or one that does not output controls.
    """
    policy = load_policy(path, sampler, name)
    if policy.info.level not in ("low", "end-to-end"):
        raise InputError(f"{path}: not a policy that outputs controls")
    return PolicyTracker(policy, seed, policy.info.level == "low", policy.info.residual)


def bundled_weights() -> Path:
    """The folder of the weights that come with the program."""
    return Path(__file__).with_name("weights")


def weights_folder() -> Path:
    """The folder of weights, unless another one is given: that in the environment, or ours."""
    return Path(os.environ.get(WEIGHTS) or bundled_weights())


def policy_path(name: str, weights: str | Path | None = None) -> Path:
    """The file of a policy.

    Args:
        name: of the policy, such as "low-diff".
        weights: folder of the weights; see `weights_folder`.

    Raises:
        InputError: it is not there.
    """
    path = Path(weights or weights_folder()) / f"{name}.onnx"
    if not path.is_file():
        raise InputError(
            f"{path} is not there: train it with `{train_command(name)}`, or name a folder of "
            f"weights in {WEIGHTS}"
        )
    return path


def train_command(policy: str) -> str:
    """The command that trains a policy, without the data that it needs."""
    return f"pianomime {_TRAINED_BY.get(policy, f'train {policy}')}"


def weight_files(method: str, weights: str | Path | None = None) -> list[Path]:
    """The files of a method's policies, in their order.

    A folder that has some of them, such as a low level of one's own, is completed by those that
    come with the program, with a warning.

    Args:
        method: one of `METHODS`.
        weights: folder of the weights; see `weights_folder`.

    Raises:
        InputError: one is in neither of the two.
    """
    folder = Path(weights or weights_folder())
    lent = _lent(method, folder)
    for name in lent:
        warnings.warn(
            f"{folder} has no {name}.onnx: the one that comes with the program plays instead",
            stacklevel=2,
        )
    return [
        policy_path(name, bundled_weights() if name in lent else folder) for name in METHODS[method]
    ]


def missing_policies(method: str, weights: str | Path | None = None) -> list[str]:
    """The policies of a method that are neither in a folder nor lent by the program.

    Args:
        method: one of `METHODS`.
        weights: folder of the weights; see `weights_folder`.
    """
    folder = Path(weights or weights_folder())
    if _lent(method, folder):
        return []
    return [name for name in METHODS[method] if not _has(folder, name)]


def methods_of(weights: Path) -> list[str]:
    """The methods that a folder of weights has all policies of.

    If there are none: those that it has some policies of, where the program brings the others.
    """
    whole = [
        method
        for method, policies in METHODS.items()
        if all(_has(weights, name) for name in policies)
    ]
    return whole or [method for method in METHODS if _lent(method, weights)]


def _lent(method: str, folder: Path) -> list[str]:
    """The policies that complete a folder which has some of a method's, if they complete it."""
    missing = [name for name in METHODS[method] if not _has(folder, name)]
    some = len(missing) < len(METHODS[method])
    return missing if some and all(_has(bundled_weights(), name) for name in missing) else []


def _has(folder: Path, name: str) -> bool:
    return (folder / f"{name}.onnx").is_file()
