"""Residual reinforcement learning of one song (paper, algorithm 1), with Stable-Baselines3's PPO.

A run can be stopped at any instant and resumes to the same learning curve. That takes two things.
All random numbers of an update come from generators that are seeded by the run's seed and the
number of the update. And between updates the worlds are set to the state that a checkpoint of them
holds, whether or not one is ever read: MuJoCo's state does not include which keys sleep, so a world
that was read from a checkpoint would otherwise differ in the last digits from one that went on.
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
from pianomime.learn.expert.expert_run import Evaluation, ExpertRun
from pianomime.learn.expert.ppo_model import Ppo, actor_network
from pianomime.learn.expert.residual_policy import ACTIVATIONS, ResidualPolicyTracker
from pianomime.learn.runs.safetensors_file import Arrays
from pianomime.learn.runs.torch_threads import torch_threads
from pianomime.plan.demonstration import DemonstrationPlanner
from pianomime.players.player import PlannedPlayer
from pianomime.progress import Progress


def train_ppo(run: ExpertRun, threads: int, progress: Progress) -> None:
    """Train until the run's steps are spent; resume from its last checkpoint.

    Args:
        run: its folder.
        threads: of the physics and of the networks; 0 for one on each core.
        progress: called with the control steps spent and those in all.

    Raises:
        InputError: the checkpoint is damaged.
        OSError: a checkpoint cannot be written; the one before stays.
    """
    settings = run.config.ppo
    env = Sb3Env(SongBatch(run.demonstration, run.config.env, settings.num_envs, threads))
    model = make_model(env, settings, run.config.seed, threads)
    model.set_logger(configure(str(run.tensorboard), ["tensorboard"]))
    callback = _ExpertCallback(run, env, progress)
    callback.curve = run.curve()
    state = run.state()
    callback.learn(model, run.config.total_steps, state, run.path)
    steps = model.num_timesteps
    if state is not None and state.steps == steps > callback.curve[-1].steps:
        # Nothing is left to learn where fewer steps are wanted than before, but to evaluate.
        callback.save(steps // settings.steps_per_update, steps)
    callback.between_updates()


def make_model(env: Sb3Env, settings: PpoConfig, seed: int, threads: int = 0) -> PPO:
    """Stable-Baselines3's PPO with these settings, untrained.

    Args:
        env: what it learns in.
        settings: of the algorithm and of the networks.
        seed: seed of all random numbers.
        threads: of the networks in updates; 0 for as many as torch would take.
    """
    hidden = list(settings.hidden)

    def learning_rate(_: float) -> float:
        update = max(model.num_timesteps // settings.steps_per_update - 1, 0)
        return settings.learning_rate * settings.learning_rate_decay**update

    model: Ppo
    model = Ppo(
        "MlpPolicy",
        env,
        learning_rate=settings.learning_rate,
        n_steps=settings.steps_per_update // settings.num_envs,
        batch_size=settings.batch_size,
        n_epochs=settings.n_epochs,
        gamma=settings.gamma,
        gae_lambda=settings.gae_lambda,
        clip_range=settings.clip_range,
        ent_coef=settings.ent_coef,
        vf_coef=settings.vf_coef,
        max_grad_norm=settings.max_grad_norm,
        target_kl=settings.target_kl or None,
        policy_kwargs={
            "net_arch": {"pi": hidden, "vf": hidden},
            "activation_fn": ACTIVATIONS[settings.activation],
            "log_std_init": math.log(settings.initial_std),
        },
        seed=seed,
        device="cpu",
    )
    model.lr_schedule = learning_rate
    model.threads = threads or torch.get_num_threads()
    return model


class _ExpertCallback(ResumableCallback):
    """Evaluates, saves the best expert and the checkpoint, and logs to TensorBoard."""

    def __init__(self, run: ExpertRun, env: Sb3Env, progress: Progress) -> None:
        super().__init__(env, run.config.seed, run.config.ppo.steps_per_update)
        self._run, self._progress = run, progress
        self.curve: list[Evaluation] = []
        self._reward_sums = {f"reward/{term.name}": 0.0 for term in env.batch.reward_terms}

    def save(self, update: int, steps: int) -> None:
        """As `ResumableCallback.save`."""
        due = update % self._run.config.ppo.evaluate_every == 0
        if due or steps >= self._run.config.total_steps:
            self._evaluate(steps)
        self._run.checkpoint(self.arrays(), steps, self.curve)

    def _on_rollout_start(self) -> None:
        super()._on_rollout_start()
        self._reward_sums = dict.fromkeys(self._reward_sums, 0.0)

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            for name in self._reward_sums:
                self._reward_sums[name] += info[name]
        best = max((one.f1 for one in self.curve), default=0.0)
        now = self.curve[-1].f1 if self.curve else 0.0
        remark = f"F1 {now:.3f}, best {best:.3f}"
        self._progress("training", self.model.num_timesteps, self._run.config.total_steps, remark)
        return True

    def _on_rollout_end(self) -> None:
        buffer = self.model.rollout_buffer  # type: ignore[attr-defined]
        self.logger.record("rollout/step_reward_mean", float(buffer.rewards.mean()))
        for name, total in self._reward_sums.items():
            self.logger.record(name, total / buffer.rewards.size)

    def _evaluate(self, steps: int) -> None:
        weights = _actor_arrays(self.model)
        tracker = ResidualPolicyTracker.from_arrays(
            self._run.demonstration, self._run.config, weights
        )
        planner, world = DemonstrationPlanner(self._run.demonstration), self._run.config.env.world
        player = PlannedPlayer("expert", planner, tracker, world=world)
        with torch_threads(1):
            metrics = player.play(self._run.demonstration.score).metrics()
        made = Evaluation(steps, metrics["precision"], metrics["recall"], metrics["f1"])
        if made.f1 > max((one.f1 for one in self.curve), default=-1.0):
            self._run.keep_best(weights, made)
        self.curve.append(made)
        for name in ("precision", "recall", "f1"):
            self.logger.record(f"eval/{name}", metrics[name])
        self.logger.dump(steps)


def _actor_arrays(model: Any) -> Arrays:
    """The weights of the actor alone, by the names that `residual_policy.actor` gives them."""
    weights = actor_network(model).state_dict()
    return {name: tensor.numpy().copy() for name, tensor in weights.items()}
