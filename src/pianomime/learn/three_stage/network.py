"""The networks of the three stages, with their normalizers and losses."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, nn

from pianomime.learn.imitation.mlp import hidden_layers
from pianomime.learn.imitation.normalizer import AsinhNormalizer, StandardNormalizer
from pianomime.learn.three_stage.config import StageConfig

_SMOOTHING = 0.02
"""Share of the choices that are taken for random (Szegedy et al., "Rethinking the Inception
architecture", 2016): fingerings are a matter of taste."""
_FAR = 0.1
"""Normalized error from which the loss grows linearly."""


class StageNetwork(nn.Module, ABC):
    """A feedforward network from observations to actions, both in their own units.

    Args:
        inputs: numbers of an observation.
        outputs: frames and numbers of an action.
        config: sizes of the layers.
    """

    def __init__(self, inputs: int, outputs: tuple[int, int], config: StageConfig) -> None:
        super().__init__()
        sizes = (inputs, *config.hidden)
        self.layers = nn.Sequential(
            *hidden_layers(sizes, config.dropout), nn.Linear(sizes[-1], int(np.prod(outputs)))
        )
        self.normalizer = StandardNormalizer(inputs)
        self.outputs = outputs

    def fit(self, sample: dict[str, NDArray[Any]]) -> None:
        """Fit the normalizers to a batch."""
        self.normalizer.fit(sample["observation"])

    @abstractmethod
    def loss(self, batch: dict[str, Tensor]) -> Tensor:
        """The mean loss of a batch: `observation` (B, .) and `target`."""

    def raw(self, observation: Tensor) -> Tensor:
        """(B, T, D) outputs of observations (B, .)."""
        out: Tensor = self.layers(self.normalizer(observation))
        return out.reshape(-1, *self.outputs)


class ChoiceNetwork(StageNetwork):
    """The first stage: a score for each choice."""

    def forward(self, observation: Tensor) -> Tensor:
        """(B, 1, CHOICES) scores."""
        return self.raw(observation)

    def loss(self, batch: dict[str, Tensor]) -> Tensor:
        """Mean cross entropy of choices (B,)."""
        scores = self(batch["observation"])[:, 0].float()
        return nn.functional.cross_entropy(
            scores, batch["target"], label_smoothing=_SMOOTHING if self.training else 0.0
        )


class MotionNetwork(StageNetwork):
    """The second and the third stage: the action itself.

    Args:
        inputs: numbers of an observation.
        outputs: frames and numbers of an action.
        config: sizes of the layers.
    """

    def __init__(self, inputs: int, outputs: tuple[int, int], config: StageConfig) -> None:
        super().__init__(inputs, outputs, config)
        self.actions = AsinhNormalizer(outputs[1])

    def fit(self, sample: dict[str, NDArray[Any]]) -> None:
        """Fit the normalizers to a batch."""
        super().fit(sample)
        self.actions.fit(sample["target"])

    def forward(self, observation: Tensor) -> Tensor:
        """(B, T, D) actions [rad, m]."""
        return self.actions.denormalize(self.raw(observation))

    def loss(self, batch: dict[str, Tensor]) -> Tensor:
        """Mean loss of normalized actions: quadratic, and linear where they are far off."""
        wanted = self.actions(batch["target"])
        return nn.functional.smooth_l1_loss(
            self.raw(batch["observation"]).float(), wanted, beta=_FAR
        )
