"""Settings of data collection by DAgger. Cheap to import: no numpy, no torch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from pianomime.device_names import CPU, DEVICES, DeviceName
from pianomime.validation import check_seed, one_of, whole_numbers, within


@dataclass(frozen=True)
class DaggerConfig:
    """Which policies play, how much noise is on their controls, and what steps the worlds."""

    noise: float = 0.2
    """Largest standard deviation [rad] of the noise on the controls of fingers; each episode has a
    random share of it. Wrists and forearms have less, so that fingertips move about as far."""
    noise_correlation: float = 0.8
    """Correlation of the noise from one frame to the next."""
    rollout_policy: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = (
        None
    )
    """Low-level policy (.onnx) whose controls are played; the expert's own if not given."""
    fingertip_policy: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")
    ] = None
    """High-level policy (.onnx) whose fingertips are followed, made feasible; the human's if not
    given."""
    max_demonstrations: int = 0
    """Number of demonstrations to play, evenly spread over all; 0 for all."""
    worlds: int = 1
    """Demonstrations that a process plays side by side, in one batch of worlds."""
    device: DeviceName = CPU
    """What steps the worlds: the cores, or a GPU of NVIDIA (the extra gpu), which wants many."""
    seed: int = 0
    """Seed of the noise and of the policies' sampling."""

    def __post_init__(self) -> None:
        whole_numbers(self)
        within("noise", self.noise, 0, 1)
        within("noise_correlation", self.noise_correlation, 0, 0.99)
        within("worlds", self.worlds, 1)
        one_of("device", self.device, DEVICES)
        within("max_demonstrations", self.max_demonstrations, 0)
        check_seed("seed", self.seed)
