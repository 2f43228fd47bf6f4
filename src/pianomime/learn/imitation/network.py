"""PolicyNetwork: a policy in training, with its goal encoder, network and normalizers."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from pianomime.learn.goal.autoencoder import CODE
from pianomime.learn.imitation.bet import BetNet
from pianomime.learn.imitation.config import PolicyConfig
from pianomime.learn.imitation.diffusion import DiffusionNet
from pianomime.learn.imitation.mlp import MlpNet
from pianomime.learn.imitation.normalizer import AsinhNormalizer, StandardNormalizer
from pianomime.learn.imitation.shapes import NetworkShape
from pianomime.policies.features import Observation

_KMEANS_SAMPLES = 20_000
"""Actions, about, from which the bins of a behaviour transformer are computed."""


class PolicyNetwork(nn.Module):
    """From observations to action chunks, both in their own units.

    Attributes:
        config: of the policy.
        action_normalizer: of the action chunks, which are relative to `action_reference`.
        net: the network proper, on encoded and normalized inputs.

    Args:
        config: of the policy.
        shapes: of a sample: `goal` (G, 88), `frames` (G, F), `vector` (V,) and `target` (T, D).
        encoder: of goals (..., 88) to codes; None where goals are used as they are.
    """

    def __init__(
        self, config: PolicyConfig, shapes: Mapping[str, tuple[int, ...]], encoder: nn.Module | None
    ) -> None:
        super().__init__()
        self.config = config
        self.encoder = encoder
        self.frame_normalizer = StandardNormalizer(shapes["frames"][-1])
        self.vector_normalizer = StandardNormalizer(shapes["vector"][-1])
        self.action_normalizer = AsinhNormalizer(shapes["target"][-1])
        frames, keys = shapes["goal"]
        code = keys if encoder is None else CODE
        chunk, action = shapes["target"]
        shape = NetworkShape(
            frames, code + shapes["frames"][-1], shapes["vector"][-1], chunk, action
        )
        self.net: DiffusionNet | BetNet | MlpNet
        if config.network == "diffusion":
            self.net = DiffusionNet(shape, config.diffusion)
        elif config.network == "bet":
            self.net = BetNet(shape, config.bet)
        else:
            self.net = MlpNet(shape, config.mlp)

    @property
    def parameter_count(self) -> int:
        """Number of trained parameters, without those of the goal encoder."""
        return sum(weight.numel() for weight in self.net.parameters())

    @property
    def frame_features(self) -> int:
        """F, numbers in `frames` of each frame ahead."""
        return len(self.frame_normalizer.mean)

    @property
    def vector_features(self) -> int:
        """V, numbers in `vector`."""
        return len(self.vector_normalizer.mean)

    @property
    def action_size(self) -> int:
        """D, numbers of the action for one frame."""
        return len(self.action_normalizer.median)

    def fit_normalizers(self, sample: Observation) -> None:
        """Fit all normalizers, and the bins of a behaviour transformer, to samples (B, ...)."""
        self.frame_normalizer.fit(sample["frames"])
        self.vector_normalizer.fit(sample["vector"])
        self.action_normalizer.fit(sample["target"])
        if isinstance(self.net, BetNet):
            from scipy.cluster.vq import kmeans2

            actions = self.action_normalizer(torch.from_numpy(sample["target"]))
            actions = actions.flatten(0, 1).numpy()
            some = actions[:: max(1, len(actions) // _KMEANS_SAMPLES)]
            centres, _ = kmeans2(some, self.net.config.bins, minit="++", seed=0)
            self.net.centres.copy_(torch.from_numpy(centres))

    def encode(self, goal: Tensor, frames: Tensor, vector: Tensor) -> tuple[Tensor, Tensor]:
        """The inputs of `net`: frames ahead (B, G, C), goal codes first, and the vector (B, V).

        Args:
            goal: (B, G, 88).
            frames: (B, G, F).
            vector: (B, V).
        """
        code = goal if self.encoder is None else self.encoder(goal)
        return torch.cat([code, self.frame_normalizer(frames)], dim=-1), self.vector_normalizer(
            vector
        )

    def forward(self, batch: dict[str, Tensor]) -> Tensor:
        """The mean loss of a batch of observations with their `target` (B, T, D)."""
        ahead, vector = self.encode(batch["goal"], batch["frames"], batch["vector"])
        return self.net.loss(ahead, vector, self.action_normalizer(batch["target"]))

    def predict(
        self,
        goal: Tensor,
        vector: Tensor,
        frames: Tensor | None = None,
        noisy: Tensor | None = None,
        step: Tensor | None = None,
    ) -> tuple[Tensor, ...]:
        """The outputs of an exported policy, see `pianomime.policies.policy.NetworkPolicy`.

        Args:
            goal: (B, G, 88).
            vector: (B, V).
            frames: (B, G, F); None if F is 0.
            noisy: (B, T, D) noisy normalized chunks, of a diffusion only.
            step: (B,) their diffusion steps.

        Returns:
            Of a diffusion, its prediction (B, T, D) in normalized actions; of a behaviour
            transformer the probability (B, T, bins) and the action (B, T, bins, D) of each bin; of
            a feedforward network the actions (B, T, D).
        """
        ahead, vector = self.encode(goal, goal[..., :0] if frames is None else frames, vector)
        if isinstance(self.net, DiffusionNet):
            return (self.net(ahead, vector, noisy, step),)
        if isinstance(self.net, BetNet):
            probability, actions = self.net(ahead, vector)
            return probability, self.action_normalizer.denormalize(actions)
        return (self.action_normalizer.denormalize(self.net(ahead, vector)),)
