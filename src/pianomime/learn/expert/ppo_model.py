"""Stable-Baselines3's PPO with a number of threads, and the actor that it trains."""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3 import PPO

from pianomime.learn.runs.torch_threads import torch_threads


class Ppo(PPO):
    """PPO whose networks use several threads in updates and one while it collects rollouts.

    Attributes:
        threads: of the networks in updates.
    """

    threads: int

    def collect_rollouts(self, *arguments: Any, **named: Any) -> bool:
        """Collect rollouts. Idle threads of the networks would take cores from the physics."""
        with torch_threads(1):
            return super().collect_rollouts(*arguments, **named)

    def train(self) -> None:
        """Update, with matrix products in bfloat16 (sums in float32) where that is faster.

        They take most of the time of an update.
        """
        precision = torch.get_float32_matmul_precision()
        torch.set_float32_matmul_precision("medium")
        try:
            with torch_threads(self.threads):
                super().train()
        finally:
            torch.set_float32_matmul_precision(precision)


def actor_network(model: Any) -> torch.nn.Sequential:
    """The actor of a PPO model, from observations to mean actions."""
    return torch.nn.Sequential(*model.policy.mlp_extractor.policy_net, model.policy.action_net)
