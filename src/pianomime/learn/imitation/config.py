"""Settings of a policy that learns by imitation: typed, saved with it, and the command line.

Every config checks itself when it is made and raises an `InputError` that names the setting as the
command line does, such as `diffusion.channels`. Cheap to import: no numpy, no torch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from pianomime.errors import InputError
from pianomime.learn.runs.trainer_config import TrainerConfig
from pianomime.policies.horizon import CHUNK, MOST_DIFFUSION_STEPS
from pianomime.validation import above_zero, one_of, whole_numbers, widths, within

Size = Literal["small", "paper"]
PolicyName = Literal[
    "high-diff",
    "high-diff-no-sdf",
    "high-bet",
    "low-diff",
    "low-diff-no-sdf",
    "low-diff-res",
    "low-bet",
    "low-mse",
    "one-stage-diff",
    "bc-mse",
]
POLICIES: tuple[PolicyName, ...] = get_args(PolicyName)
LEVELS = ("high", "low", "end-to-end")
NETWORKS = ("diffusion", "bet", "mlp")

GROUPS = 8
"""Channels are normalized in this many groups (Wu and He, "Group normalization", 2018)."""


@dataclass(frozen=True)
class DiffusionConfig:
    """A U-Net that takes the noise off action chunks (paper, table 7)."""

    channels: tuple[int, ...] = (32, 64, 128)
    """Filters of each level of the U-Net."""
    kernel_size: int = 5
    """Frames in a kernel of the U-Net's convolutions."""
    encoder_channels: tuple[int, ...] = (32, 64)
    """Filters of the temporal convolutions that encode the frames ahead."""
    encoder_kernel_size: int = 3
    """Frames in a kernel of those."""
    condition_layers: tuple[int, ...] = (768, 768)
    """Widths of the layers between the encoded observation and FiLM; none to use it directly."""
    skip: bool = True
    """Add a linear prediction from the condition to the output of the U-Net."""
    step_embedding: int = 64
    """Size of the sinusoidal embedding of the diffusion step."""
    steps: int = 100
    """Diffusion steps in training."""
    prediction: Literal["epsilon", "sample"] = "sample"
    """What the network predicts: the noise, or the chunk without it."""

    def __post_init__(self) -> None:
        whole_numbers(self, "diffusion")
        levels = len(self.channels)
        if not levels or CHUNK % 2 ** (levels - 1):
            raise InputError(
                f"diffusion.channels: a U-Net over {CHUNK} frames has 1 to 3 levels, not {levels}"
            )
        for name in ("channels", "encoder_channels"):
            widths = getattr(self, name)
            if not widths or any(width < 1 or width % GROUPS for width in widths):
                option = name.replace("_", "-")
                raise InputError(f"diffusion.{option} must be multiples of {GROUPS}, not {widths}")
        for name in ("kernel_size", "encoder_kernel_size"):
            size = getattr(self, name)
            if size < 1 or not size % 2:
                raise InputError(f"diffusion.{name.replace('_', '-')} must be odd, not {size}")
        for width in self.condition_layers:
            within("diffusion.condition_layers", width, 1)
        if self.step_embedding < 4 or self.step_embedding % 2:
            raise InputError(
                f"diffusion.step-embedding must be even, from 4 on, not {self.step_embedding}"
            )
        within("diffusion.steps", self.steps, 2, MOST_DIFFUSION_STEPS)
        one_of("diffusion.prediction", self.prediction, ("epsilon", "sample"))


@dataclass(frozen=True)
class BetConfig:
    """A behaviour transformer: one of some typical actions, and its correction (paper, table 8)."""

    layers: int = 4
    """Transformer layers."""
    heads: int = 4
    """Attention heads of each layer."""
    width: int = 64
    """Size of the tokens."""
    bins: int = 64
    """Number of typical actions, the centres of k-means."""
    offset_weight: float = 10.0
    """Weight of the loss of the correction, beside that of the choice of a bin."""

    def __post_init__(self) -> None:
        whole_numbers(self, "bet")
        for name, least, most in (
            ("layers", 1, 64),
            ("heads", 1, 64),
            ("width", 1, 8192),
            ("bins", 2, 1024),
        ):
            within(f"bet.{name}", getattr(self, name), least, most)
        if self.width % self.heads:
            raise InputError(
                f"bet.width ({self.width}) must be a multiple of bet.heads ({self.heads})"
            )
        above_zero("bet.offset_weight", self.offset_weight)


@dataclass(frozen=True)
class MlpConfig:
    """A plain feedforward network (paper, appendix G, BC-MSE)."""

    hidden: tuple[int, ...] = (512, 512, 512)
    """Widths of the hidden layers."""

    def __post_init__(self) -> None:
        whole_numbers(self, "mlp")
        widths("mlp.hidden", self.hidden)


_DEFAULTS = {"diffusion": DiffusionConfig(), "bet": BetConfig(), "mlp": MlpConfig()}


@dataclass(frozen=True)
class PolicyConfig:
    """One policy of a generalist. The first four settings are what its name stands for."""

    level: Annotated[Literal["high", "low", "end-to-end"], tyro.conf.Suppress]
    """From goals to fingertips, from fingertips to controls, or from goals straight to controls."""
    network: Annotated[Literal["diffusion", "bet", "mlp"], tyro.conf.Suppress]
    """Kind of network."""
    goal_encoding: Annotated[Literal["sdf", "binary"], tyro.conf.Suppress] = "sdf"
    """Goals as codes of the goal encoder, or as 88 zeros and ones."""
    residual: Annotated[bool, tyro.conf.Suppress] = False
    """Predict what to add to the controls of inverse kinematics."""
    transpose: bool = True
    """Augment the data: move samples by an octave up or down at random."""
    tip_noise: float = 0.0
    """Standard deviation [m] of the noise on each present fingertip in training, high levels."""
    hand_noise: float = 0.0
    """Standard deviation [m] of the noise on whole hands along the keyboard in training, high
    levels: they learn to recover from their own drift."""
    target_noise: float = 0.0
    """Standard deviation [m] of the noise on the targets of wrists and idle fingertips in training,
    low levels: a high level is only roughly right."""
    diffusion: DiffusionConfig = field(default_factory=DiffusionConfig)
    bet: BetConfig = field(default_factory=BetConfig)
    mlp: MlpConfig = field(default_factory=MlpConfig)
    trainer: TrainerConfig = field(
        default_factory=lambda: TrainerConfig(steps=5_000, learning_rate=1e-3)
    )

    def __post_init__(self) -> None:
        one_of("level", self.level, LEVELS)
        one_of("network", self.network, NETWORKS)
        one_of("goal_encoding", self.goal_encoding, ("sdf", "binary"))
        for name, level in (("tip_noise", "high"), ("hand_noise", "high"), ("target_noise", "low")):
            within(name, getattr(self, name), 0, 1)
            if getattr(self, name) and self.level != level:
                option = name.replace("_", "-")
                raise InputError(f"{option} does nothing here: it is for {level} levels")
        for name, default in _DEFAULTS.items():
            if name != self.network and getattr(self, name) != default:
                raise InputError(f"{name}.* does nothing here: this policy is {self.network}")

    @property
    def chunk(self) -> int:
        """Frames of actions that are predicted at once; a feedforward network predicts one."""
        return 1 if self.network == "mlp" else CHUNK


_TIP_NOISE, _HAND_NOISE = 0.01, 0.06
_TARGET_NOISE = 0.008
# Controls take longer to learn than fingertips, and plain networks are quick.
_LONG, _PLAIN = (TrainerConfig(steps=steps, learning_rate=1e-3) for steps in (10_000, 15_000))

_CONFIGS: dict[PolicyName, PolicyConfig] = {
    "high-diff": PolicyConfig("high", "diffusion", tip_noise=_TIP_NOISE, hand_noise=_HAND_NOISE),
    "high-diff-no-sdf": PolicyConfig(
        "high", "diffusion", "binary", tip_noise=_TIP_NOISE, hand_noise=_HAND_NOISE
    ),
    "high-bet": PolicyConfig("high", "bet", tip_noise=_TIP_NOISE, hand_noise=_HAND_NOISE),
    "low-diff": PolicyConfig("low", "diffusion", target_noise=_TARGET_NOISE, trainer=_LONG),
    "low-diff-no-sdf": PolicyConfig(
        "low", "diffusion", "binary", target_noise=_TARGET_NOISE, trainer=_LONG
    ),
    "low-diff-res": PolicyConfig(
        "low", "diffusion", residual=True, target_noise=_TARGET_NOISE, trainer=_LONG
    ),
    "low-bet": PolicyConfig("low", "bet", target_noise=_TARGET_NOISE, trainer=_LONG),
    "low-mse": PolicyConfig(
        "low",
        "mlp",
        "binary",
        target_noise=_TARGET_NOISE,
        mlp=MlpConfig((768, 768, 768)),
        trainer=_PLAIN,
    ),
    "one-stage-diff": PolicyConfig("end-to-end", "diffusion", trainer=_LONG),
    "bc-mse": PolicyConfig("end-to-end", "mlp", "binary", trainer=_PLAIN),
}

_PAPER = {
    "diffusion": DiffusionConfig(
        channels=(256, 512, 1024),
        condition_layers=(),
        skip=False,
        step_embedding=256,
        prediction="epsilon",
    ),
    "bet": BetConfig(layers=8, heads=8, width=120),
    "mlp": MlpConfig(hidden=(1024, 1024, 1024)),
}
"""Networks of tables 7 and 8, and of appendix G."""

_PAPER_SAMPLES = 110_000
"""Pairs of state and action in the paper's data."""


def check_sources(
    name: str, config: PolicyConfig, demonstrations: Path | None, experts: Sequence[Path]
) -> None:
    """Refuse to train a policy on data that it cannot learn from; whether they exist is not asked.

    Args:
        name: of the policy.
        config: of the policy.
        demonstrations: where high levels find demonstrations; None to learn from `experts`.
        experts: data sets of trajectories.

    Raises:
        InputError: there are none, of both kinds, or of the wrong one.
    """
    if demonstrations is not None and experts:
        raise InputError("--demonstrations and --experts: name one of the two")
    if demonstrations is not None and config.level != "high":
        raise InputError(
            f"{name} learns controls, which demonstrations do not have: name data sets made by "
            "`pianomime collect-dagger` with --experts"
        )
    if demonstrations is None and not experts:
        more = ", or demonstrations with --demonstrations" if config.level == "high" else ""
        raise InputError(
            f"{name} needs data: name data sets made by `pianomime collect-dagger` with "
            f"--experts{more}"
        )


def policy_config(name: PolicyName, size: Size = "small") -> PolicyConfig:
    """The default config of a policy by its name.

    The paper's size is trained as in its tables 7 and 8: as many epochs, at its learning rates.
    """
    config = _CONFIGS[name]
    if size == "small":
        return config
    learning_rate = 3e-4 if config.network == "bet" else 1e-4
    epochs = 1200 if config.network == "bet" else 800
    steps = epochs * _PAPER_SAMPLES // config.trainer.batch
    return replace(
        config,
        trainer=replace(config.trainer, steps=steps, learning_rate=learning_rate),
        **{config.network: _PAPER[config.network]},  # type: ignore[arg-type]
    )
