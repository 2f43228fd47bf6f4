"""A behaviour transformer: the nearest of some typical actions, and how far off it is (table 8)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from pianomime.learn.imitation.config import BetConfig
from pianomime.learn.imitation.shapes import Sizes


class BetNet(nn.Module):
    """Attention over the frames ahead, what is seen besides, and one question a frame to be said.

    Attributes:
        centres: (bins, D) typical actions, a part of the weights.

    Args:
        sizes: of what is given and said.
        config: its own.
    """

    centres: Tensor

    def __init__(self, sizes: Sizes, config: BetConfig) -> None:
        super().__init__()
        wide = config.width
        self.config, self.chunk = config, sizes.chunk
        self.ahead, self.vector = nn.Linear(sizes.channels, wide), nn.Linear(sizes.vector, wide)
        asked = sizes.frames + 1 + sizes.chunk
        self.place = nn.Parameter(0.02 * torch.randn(asked, wide))
        layer = nn.TransformerEncoderLayer(
            wide, config.heads, 4 * wide, 0.1, "gelu", batch_first=True, norm_first=True
        )
        self.layers = nn.TransformerEncoder(layer, config.layers, enable_nested_tensor=False)
        self.normal = nn.LayerNorm(wide)
        self.choice = nn.Linear(wide, config.bins)
        self.offset = nn.Linear(wide, config.bins * sizes.width)
        self.register_buffer("centres", torch.zeros(config.bins, sizes.width))

    def forward(self, ahead: Tensor, vector: Tensor) -> tuple[Tensor, Tensor]:
        """(B, T, bins) how likely each typical action is, and (B, T, bins, D) each made exact."""
        # Not len(): ONNX export would take the batch of its example for that of all.
        asked = ahead.new_zeros(ahead.shape[0], self.chunk, self.place.shape[1])
        tokens = torch.cat([self.ahead(ahead), self.vector(vector)[:, None], asked], dim=1)
        out = self.normal(self.layers(tokens + self.place))[:, -self.chunk :]
        offset = self.offset(out).reshape(*out.shape[:2], *self.centres.shape)
        return self.choice(out).softmax(-1), self.centres + offset

    def loss(self, ahead: Tensor, vector: Tensor, target: Tensor) -> Tensor:
        """Of the choice, and of the offset from the typical action that is nearest."""
        chance, exact = self(ahead, vector)
        nearest = torch.cdist(target, self.centres.expand(len(target), -1, -1)).argmin(-1)
        chosen = nn.functional.nll_loss(
            chance.float().clamp_min(1e-8).log().flatten(0, 1), nearest.flatten()
        )
        index = nearest[..., None, None].expand(-1, -1, 1, target.shape[-1])
        off = nn.functional.mse_loss(exact.float().gather(2, index)[:, :, 0], target)
        return chosen + self.config.offset_weight * off
