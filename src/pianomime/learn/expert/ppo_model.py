"""Stable-Baselines3's PPO, and what is learned by it."""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3 import PPO

from pianomime.learn.runs.torch_threads import torch_threads


class Ppo(PPO):
    """PPO that leaves the cores to whoever needs them.

    Attributes:
        threads: of the networks in updates.
    """

    threads: int

    def collect_rollouts(self, *arguments: Any, **named: Any) -> bool:
        """Play. Threads of networks that wait for the next pass would keep cores from physics."""
        with torch_threads(1):
            return super().collect_rollouts(*arguments, **named)

    def train(self) -> None:
        """Learn, with the products of matrices in bfloat16 (sums in float32) where that is faster.

        They are most of an update.
        """
        precision = torch.get_float32_matmul_precision()
        torch.set_float32_matmul_precision("medium")
        try:
            with torch_threads(self.threads):
                super().train()
        finally:
            torch.set_float32_matmul_precision(precision)


def actor_network(model: Any) -> torch.nn.Sequential:
    """The actor alone, from observations to mean actions."""
    return torch.nn.Sequential(*model.policy.mlp_extractor.policy_net, model.policy.action_net)
