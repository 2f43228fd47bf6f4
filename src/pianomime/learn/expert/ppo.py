"""Residual reinforcement learning of one song (paper, algorithm 1), with Stable-Baselines3's PPO.

A run can be stopped at any instant and goes on to the same curve. That takes two things. All that
is drawn during an update is drawn from generators seeded by the run's seed and the number of the
update. And between updates the worlds are put where a checkpoint of them would put them, whether or
not one is ever read: MuJoCo does not tell which keys sleep, so a world that was read from a
checkpoint would otherwise differ in the last digits from one that went on.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure

from pianomime.learn.envs.batch import SongBatch
from pianomime.learn.envs.checkpoint_callback import ResumableCallback
from pianomime.learn.envs.sb3_env import Sb3Env
from pianomime.learn.expert.config import PpoConfig
from pianomime.learn.expert.ppo_model import Ppo, actor_network
from pianomime.learn.expert.residual_policy import ACTIVATIONS, ResidualPolicyTracker
from pianomime.learn.runs.run import Evaluation, RunFolder
from pianomime.learn.runs.safetensors_file import Arrays
from pianomime.learn.runs.tell import Tell
from pianomime.learn.runs.torch_threads import torch_threads
from pianomime.plan.demonstration import DemonstrationPlanner
from pianomime.players.player import Player


def train_ppo(run: RunFolder, threads: int, tell: Tell) -> None:
    """Train until the run's steps are spent; go on where it was.

    Args:
        run: its folder.
        threads: of the physics and of the networks; 0 for one on each core.
        tell: told how far it is.

    Raises:
        InputError: the checkpoint is damaged.
        OSError: a checkpoint cannot be written; the one before stays.
    """
    settings = run.config.ppo
    env = Sb3Env(SongBatch(run.song, run.config.env, settings.envs, threads))
    model = make_model(env, settings, run.config.seed, threads)
    model.set_logger(configure(str(run.tensorboard), ["tensorboard"]))
    boundary = _Boundary(run, env, tell)
    state = None
    kept = run.state()
    if kept is not None:
        arrays, about = kept
        boundary.curve = [Evaluation(**row) for row in about["curve"]]
        state = arrays, int(about["steps"])
    boundary.learn(model, run.config.steps, state, run.path)
    boundary.between_updates()


def make_model(env: Sb3Env, settings: PpoConfig, seed: int, threads: int = 0) -> PPO:
    """Stable-Baselines3's PPO with these settings, untrained.

    Args:
        env: to learn in.
        settings: how.
        seed: of all that is drawn.
        threads: of the networks in updates; 0 for as many as torch would take.
    """
    hidden = list(settings.hidden)

    def learning_rate(_: float) -> float:
        update = max(model.num_timesteps // settings.steps_per_update - 1, 0)
        return settings.learning_rate * settings.decay**update

    model: Ppo
    model = Ppo(
        "MlpPolicy",
        env,
        learning_rate=settings.learning_rate,
        n_steps=settings.steps_per_update // settings.envs,
        batch_size=settings.batch,
        n_epochs=settings.epochs,
        gamma=settings.discount,
        gae_lambda=settings.gae,
        clip_range=settings.clip,
        ent_coef=settings.entropy,
        vf_coef=settings.value,
        max_grad_norm=settings.gradient_norm,
        target_kl=settings.target_kl or None,
        policy_kwargs={
            "net_arch": {"pi": hidden, "vf": hidden},
            "activation_fn": ACTIVATIONS[settings.activation],
            "log_std_init": math.log(settings.noise),
        },
        seed=seed,
        device="cpu",
    )
    model.lr_schedule = learning_rate
    model.threads = threads or torch.get_num_threads()
    return model


class _Boundary(ResumableCallback):
    """Evaluates, keeps the best and writes a checkpoint."""

    def __init__(self, run: RunFolder, env: Sb3Env, tell: Tell) -> None:
        super().__init__(env, run.config.seed, run.config.ppo.steps_per_update)
        self._run, self._tell = run, tell
        self.curve: list[Evaluation] = []

    def keep(self, update: int, steps: int) -> None:
        """As `ResumableCallback.keep`."""
        due = update % self._run.config.ppo.evaluate_every == 0
        if due or steps >= self._run.config.steps:
            self._evaluate(steps)
        self._run.checkpoint(self.arrays(), {"steps": steps}, self.curve)

    def _on_step(self) -> bool:
        best = max((one.f1 for one in self.curve), default=0.0)
        now = self.curve[-1].f1 if self.curve else 0.0
        remark = f"F1 {now:.3f}, best {best:.3f}"
        self._tell(self.model.num_timesteps, self._run.config.steps, remark)
        return True

    def _evaluate(self, steps: int) -> None:
        weights = _actor_arrays(self.model)
        tracker = ResidualPolicyTracker.from_arrays(self._run.song, self._run.config, weights)
        player = Player("expert", DemonstrationPlanner(self._run.song), tracker)
        with torch_threads(1):
            metrics = player.play(self._run.song.score).metrics()
        made = Evaluation(steps, metrics["precision"], metrics["recall"], metrics["f1"])
        if made.f1 > max((one.f1 for one in self.curve), default=-1.0):
            self._run.keep_best(weights, made)
        self.curve.append(made)
        for name in ("precision", "recall", "f1"):
            self.logger.record(f"song/{name}", metrics[name])
        if steps:
            buffer = self.model.rollout_buffer  # type: ignore[attr-defined]
            self.logger.record("song/reward", float(buffer.rewards.mean()))
        self.logger.dump(steps)


def _actor_arrays(model: Any) -> Arrays:
    """The weights of the actor alone, by the names that `residual_policy.actor` gives them."""
    weights = actor_network(model).state_dict()
    return {name: tensor.numpy().copy() for name, tensor in weights.items()}
