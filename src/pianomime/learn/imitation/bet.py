"""Behaviour transformer: which of some typical actions, and a correction to it (paper, table 8).

After Shafiullah et al., "Behavior transformers: cloning k modes with one stone", 2022.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from pianomime.learn.imitation.config import BetConfig
from pianomime.learn.imitation.shapes import NetworkShape


class BetNet(nn.Module):
    """A transformer encoder over the frames ahead, the vector, and one query for each action frame.

    Attributes:
        centres: (bins, D) typical actions, normalized: the centres of k-means; part of the weights.

    Args:
        shape: of inputs and output.
        config: sizes of the layers.
    """

    centres: Tensor

    def __init__(self, shape: NetworkShape, config: BetConfig) -> None:
        super().__init__()
        width = config.width
        self.config, self.chunk = config, shape.chunk
        self.ahead, self.vector = nn.Linear(shape.channels, width), nn.Linear(shape.vector, width)
        tokens = shape.frames + 1 + shape.chunk
        self.position = nn.Parameter(0.02 * torch.randn(tokens, width))
        layer = nn.TransformerEncoderLayer(
            width, config.heads, 4 * width, 0.1, "gelu", batch_first=True, norm_first=True
        )
        self.layers = nn.TransformerEncoder(layer, config.layers, enable_nested_tensor=False)
        self.norm = nn.LayerNorm(width)
        self.choice = nn.Linear(width, config.bins)
        self.offset = nn.Linear(width, config.bins * shape.action)
        self.register_buffer("centres", torch.zeros(config.bins, shape.action))

    def forward(self, ahead: Tensor, vector: Tensor) -> tuple[Tensor, Tensor]:
        """Probability of each bin (B, T, bins), and its corrected action (B, T, bins, D).

        Args:
            ahead: (B, G, C) frames ahead.
            vector: (B, V).
        """
        # Not len(): ONNX export would take the batch of its example for that of all.
        queries = ahead.new_zeros(ahead.shape[0], self.chunk, self.position.shape[1])
        tokens = torch.cat([self.ahead(ahead), self.vector(vector)[:, None], queries], dim=1)
        out = self.norm(self.layers(tokens + self.position))[:, -self.chunk :]
        offset = self.offset(out).reshape(*out.shape[:2], *self.centres.shape)
        return self.choice(out).softmax(-1), self.centres + offset

    def loss(self, ahead: Tensor, vector: Tensor, target: Tensor) -> Tensor:
        """Cross-entropy of the nearest bin, and the weighted squared error of its correction."""
        probability, actions = self(ahead, vector)
        nearest = torch.cdist(target, self.centres.expand(len(target), -1, -1)).argmin(-1)
        choice_loss = nn.functional.nll_loss(
            probability.float().clamp_min(1e-8).log().flatten(0, 1), nearest.flatten()
        )
        index = nearest[..., None, None].expand(-1, -1, 1, target.shape[-1])
        offset_loss = nn.functional.mse_loss(actions.float().gather(2, index)[:, :, 0], target)
        return choice_loss + self.config.offset_weight * offset_loss
