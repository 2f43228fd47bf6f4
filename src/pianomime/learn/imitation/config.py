"""Every choice in learning a generalist: typed, saved with it, and the command line."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, get_args

import tyro

from pianomime.errors import InputError
from pianomime.learn.imitation.trainer_config import TrainerConfig, check_fit
from pianomime.learn.runs.validation import above_zero, within
from pianomime.policies.horizon import CHUNK

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


GROUPS = 8
"""Of the channels of a convolution, each normalised by itself."""


@dataclass(frozen=True)
class DiffusionConfig:
    """A U-Net that takes noise off chunks (paper, table 7)."""

    channels: tuple[int, ...] = (32, 64, 128)
    """Filters of each level of the U-Net."""
    kernel: int = 5
    """Of its convolutions."""
    encoder: tuple[int, ...] = (32, 64)
    """Filters of the temporal convolutions over what is seen of the frames ahead."""
    encoder_kernel: int = 3
    """Of those."""
    condition: tuple[int, ...] = (768, 768)
    """Width of the layers that bring together all that is seen; none to leave it as it is."""
    guess: bool = True
    """Whether what is seen also says a chunk straight away, to which the U-Net adds."""
    step_width: int = 64
    """Numbers that tell the step of the diffusion."""
    steps: int = 100
    """Steps of the diffusion."""
    prediction: Literal["epsilon", "sample"] = "sample"
    """What the network says: the noise, or what is without it."""


@dataclass(frozen=True)
class BetConfig:
    """A behaviour transformer: which of some typical actions, and how far off (paper, table 8)."""

    layers: int = 4
    heads: int = 4
    width: int = 64
    bins: int = 64
    """Typical actions: what is said of one frame."""
    offset_weight: float = 10.0
    """Of the loss of the offset, beside that of the choice."""


@dataclass(frozen=True)
class MlpConfig:
    """A network without structure (paper, appendix G, BC-MSE)."""

    hidden: tuple[int, ...] = (512, 512, 512)
    """Width of each hidden layer."""


@dataclass(frozen=True)
class PolicyConfig:
    """One network of a generalist. The first four are what its name stands for."""

    level: Annotated[Literal["high", "low", "whole"], tyro.conf.Suppress]
    """From goals to fingertips, from fingertips to controls, or from goals to controls at once."""
    network: Annotated[Literal["diffusion", "bet", "mlp"], tyro.conf.Suppress]
    """Its kind."""
    code: Annotated[Literal["sdf", "binary"], tyro.conf.Suppress] = "sdf"
    """How goals are told: by the goal encoder, or as they are."""
    prior: Annotated[bool, tyro.conf.Suppress] = False
    """Whether controls are told as what to add to those of inverse kinematics."""
    transpose: bool = True
    """Whether samples are moved by octaves by chance."""
    tip_noise: float = 0.0
    """[m] Noise that is added to each present fingertip in training."""
    hand_noise: float = 0.0
    """[m] Noise along the keyboard that is added to whole hands in training: from where they have
    strayed to they learn to come back."""
    target_noise: float = 0.0
    """[m] Noise that is added in training to the targets of hands and of idle fingertips: a high
    level is only about right."""
    diffusion: DiffusionConfig = field(default_factory=DiffusionConfig)
    bet: BetConfig = field(default_factory=BetConfig)
    mlp: MlpConfig = field(default_factory=MlpConfig)
    fit: TrainerConfig = field(
        default_factory=lambda: TrainerConfig(steps=5_000, learning_rate=1e-3)
    )

    @property
    def chunk(self) -> int:
        """Frames that are said at once; a feedforward network says the next one."""
        return 1 if self.network == "mlp" else CHUNK


def check_stage(config: PolicyConfig) -> None:
    """Refuse settings out of range, or that do not fit together.

    Raises:
        InputError: the first of them, as it is called on the command line.
    """
    for name, level in (("tip_noise", "high"), ("hand_noise", "high"), ("target_noise", "low")):
        within(name, getattr(config, name), 0, 1)
        if getattr(config, name) and config.level != level:
            option = name.replace("_", "-")
            raise InputError(f"{option} does nothing here: it is for {level} levels")
    networks = {"diffusion": _check_diffusion, "bet": _check_bet, "mlp": _check_mlp}
    networks.pop(config.network)(config)
    for name in networks:
        if getattr(config, name) != _UNUSED[name]:
            raise InputError(f"{name}.* does nothing here: this stage is {config.network}")
    check_fit(config.fit)


_UNUSED = {"diffusion": DiffusionConfig(), "bet": BetConfig(), "mlp": MlpConfig()}


def _check_diffusion(stage: PolicyConfig) -> None:
    config = stage.diffusion
    levels = len(config.channels)
    if not levels or CHUNK % 2 ** (levels - 1):
        raise InputError(
            f"diffusion.channels: a U-Net over {CHUNK} frames has 1 to 3 levels, not {levels}"
        )
    for name in ("channels", "encoder"):
        widths = getattr(config, name)
        if not widths or any(width < 1 or width % GROUPS for width in widths):
            raise InputError(f"diffusion.{name} must be multiples of {GROUPS}, not {widths}")
    for name in ("kernel", "encoder_kernel"):
        size = getattr(config, name)
        if size < 1 or not size % 2:
            raise InputError(f"diffusion.{name.replace('_', '-')} must be odd, not {size}")
    for width in config.condition:
        within("diffusion.condition", width, 1)
    if config.step_width < 4 or config.step_width % 2:
        raise InputError(f"diffusion.step-width must be even, from 4 on, not {config.step_width}")
    within("diffusion.steps", config.steps, 2)


def _check_bet(stage: PolicyConfig) -> None:
    config = stage.bet
    for name, least in (("layers", 1), ("heads", 1), ("width", 1), ("bins", 2)):
        within(f"bet.{name}", getattr(config, name), least)
    if config.width % config.heads:
        raise InputError(
            f"bet.width ({config.width}) must be a multiple of bet.heads ({config.heads})"
        )
    above_zero("bet.offset_weight", config.offset_weight)


def _check_mlp(stage: PolicyConfig) -> None:
    for width in stage.mlp.hidden:
        within("mlp.hidden", width, 1)


_TIPS, _HANDS = 0.01, 0.06
_TARGETS = 0.008
# Controls take longer to learn than fingertips, and plain networks are quick.
_LONG, _PLAIN = (TrainerConfig(steps=steps, learning_rate=1e-3) for steps in (10_000, 15_000))

_STAGES: dict[PolicyName, PolicyConfig] = {
    "high-diff": PolicyConfig("high", "diffusion", tip_noise=_TIPS, hand_noise=_HANDS),
    "high-diff-no-sdf": PolicyConfig(
        "high", "diffusion", "binary", tip_noise=_TIPS, hand_noise=_HANDS
    ),
    "high-bet": PolicyConfig("high", "bet", tip_noise=_TIPS, hand_noise=_HANDS),
    "low-diff": PolicyConfig("low", "diffusion", target_noise=_TARGETS, fit=_LONG),
    "low-diff-no-sdf": PolicyConfig("low", "diffusion", "binary", target_noise=_TARGETS, fit=_LONG),
    "low-diff-res": PolicyConfig("low", "diffusion", prior=True, target_noise=_TARGETS, fit=_LONG),
    "low-bet": PolicyConfig("low", "bet", target_noise=_TARGETS, fit=_LONG),
    "low-mse": PolicyConfig(
        "low",
        "mlp",
        "binary",
        target_noise=_TARGETS,
        mlp=MlpConfig((768, 768, 768)),
        fit=_PLAIN,
    ),
    "one-stage-diff": PolicyConfig("whole", "diffusion", fit=_LONG),
    "bc-mse": PolicyConfig("whole", "mlp", "binary", fit=_PLAIN),
}

_PAPER = {
    "diffusion": DiffusionConfig(
        channels=(256, 512, 1024), condition=(), guess=False, step_width=256, prediction="epsilon"
    ),
    "bet": BetConfig(layers=8, heads=8, width=120),
    "mlp": MlpConfig(hidden=(1024, 1024, 1024)),
}
"""Tables 7 and 8, and appendix G."""


def policy_config(stage: PolicyName, size: Size = "small") -> PolicyConfig:
    """The config of a stage by its name.

    The paper's size is trained as in its tables: as many passes over the data, at its rates.
    """
    config = _STAGES[stage]
    if size == "small":
        return config
    rate = 3e-4 if config.network == "bet" else 1e-4
    epochs = 1200 if config.network == "bet" else 800
    steps = epochs * _FRAMES // config.fit.batch
    return replace(
        config,
        fit=replace(config.fit, steps=steps, learning_rate=rate),
        **{config.network: _PAPER[config.network]},  # type: ignore[arg-type]
    )


_FRAMES = 110_000
"""Pairs of state and action in the paper's data."""
