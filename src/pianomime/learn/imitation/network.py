"""Stage: one network of a generalist, with all that it needs to be used: codes and scales."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from pianomime.learn.goal.autoencoder import CODE
from pianomime.learn.imitation.bet import BetNet
from pianomime.learn.imitation.config import PolicyConfig
from pianomime.learn.imitation.diffusion import DiffusionNet
from pianomime.learn.imitation.mlp import MlpNet
from pianomime.learn.imitation.normalizer import SaidScale, Scale
from pianomime.learn.imitation.shapes import Sizes
from pianomime.policies.features import Arrays


class Stage(nn.Module):
    """From what is seen to what is said, in their own units.

    Args:
        config: which.
        shapes: of a sample: `goal` (G, 88), `frames` (C, F), `vector` (V,) and `target` (T, D).
        encoder: of goals (..., 88) to codes; None where they are told as they are.
    """

    def __init__(
        self, config: PolicyConfig, shapes: dict[str, tuple[int, ...]], encoder: nn.Module | None
    ) -> None:
        super().__init__()
        self.config = config
        self.encoder = encoder
        self.frames, self.vector = Scale(shapes["frames"][-1]), Scale(shapes["vector"][-1])
        self.target = SaidScale(shapes["target"][-1])
        frames, keys = shapes["goal"]
        code = keys if encoder is None else CODE
        chunk, width = shapes["target"]
        sizes = Sizes(frames, code + shapes["frames"][-1], shapes["vector"][-1], chunk, width)
        self.net: DiffusionNet | BetNet | MlpNet
        if config.network == "diffusion":
            self.net = DiffusionNet(sizes, config.diffusion)
        elif config.network == "bet":
            self.net = BetNet(sizes, config.bet)
        else:
            self.net = MlpNet(sizes, config.mlp)

    @property
    def parameters_learned(self) -> int:
        """Number of parameters, without those of the goal encoder."""
        return sum(weight.numel() for weight in self.net.parameters())

    def fit_scales(self, sample: Arrays) -> None:
        """Take all scales, and the typical actions of a transformer, from samples (B, ...)."""
        self.frames.fit(sample["frames"])
        self.vector.fit(sample["vector"])
        self.target.fit(sample["target"])
        if isinstance(self.net, BetNet):
            from scipy.cluster.vq import kmeans2

            said = self.target(torch.from_numpy(sample["target"])).flatten(0, 1).numpy()
            bins = self.net.config.bins
            centres, _ = kmeans2(said[:: max(1, len(said) // 20_000)], bins, minit="++", seed=0)
            self.net.centres.copy_(torch.from_numpy(centres))

    def seen(self, goal: Tensor, frames: Tensor, vector: Tensor) -> tuple[Tensor, Tensor]:
        """Codes of goals with what else is seen of their frames (B, G, C); and the rest (B, V)."""
        code = goal if self.encoder is None else self.encoder(goal)
        return torch.cat([code, self.frames(frames)], dim=-1), self.vector(vector)

    def forward(self, batch: dict[str, Tensor]) -> Tensor:
        """The loss of a batch."""
        ahead, vector = self.seen(batch["goal"], batch["frames"], batch["vector"])
        return self.net.loss(ahead, vector, self.target(batch["target"]))
