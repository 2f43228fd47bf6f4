"""RoboPianist's side of `speed_learn.py`, which starts it in RoboPianist's own Python.

Its environment, with the options of PianoMime's published code as in `robopianist_worker.py`, in
Stable-Baselines3's SubprocVecEnv, as its users run it. Messages are lines of JSON: first the sizes
of observation and action, then steps and seconds for each request ("environment" or "ppo").
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv

from robopianist_worker import load, stiffen


class RoboPianistEnv(gymnasium.Env):
    """dm_control's environment for Gymnasium, with observations in one row."""

    def __init__(self) -> None:
        self.environment = load()
        stiffen(self.environment.physics.model.ptr)
        self.spec_of_actions = self.environment.action_spec()
        size = len(self.row(self.environment.reset().observation))
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, self.spec_of_actions.shape, np.float32)

    def row(self, observation: Any) -> np.ndarray:
        """All of an observation in one row."""
        return np.concatenate([np.ravel(part) for part in observation.values()]).astype(np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[np.ndarray, dict]:
        """Begin the song."""
        super().reset(seed=seed)
        return self.row(self.environment.reset().observation), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Play one frame; actions -1..1 over the actuators' ranges."""
        low, high = self.spec_of_actions.minimum, self.spec_of_actions.maximum
        step = self.environment.step(low + (np.clip(action, -1, 1) + 1) / 2 * (high - low))
        return self.row(step.observation), float(step.reward or 0.0), step.last(), False, {}


def main() -> None:
    envs, steps, update, batch, threads = map(int, sys.argv[1:])
    torch.set_num_threads(threads)
    vec = SubprocVecEnv([RoboPianistEnv] * envs, start_method="spawn")
    vec.reset()
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (steps, envs, *vec.action_space.shape)).astype(np.float32) * 0.1
    model = PPO(
        "MlpPolicy",
        vec,
        n_steps=update // envs,
        batch_size=batch,
        n_epochs=10,
        policy_kwargs={
            "net_arch": {"pi": [1024, 256], "vf": [1024, 256]},
            "activation_fn": torch.nn.GELU,
        },
        device="cpu",
    )

    def send(**message: Any) -> None:
        print(json.dumps(message), flush=True)

    send(observations=vec.observation_space.shape[0], actions=vec.action_space.shape[0])
    for line in sys.stdin:
        start = time.perf_counter()
        if json.loads(line)["mode"] == "environment":
            for action in actions:
                vec.step(action)
            send(steps=steps * envs, seconds=time.perf_counter() - start)
        else:
            model.learn(update)
            send(steps=update, seconds=time.perf_counter() - start)
    vec.close()


if __name__ == "__main__":
    main()
