"""Training of the finger residual, from MIDI files to the file that is played."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from contextlib import closing
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.logger import Logger
from torch import Tensor, nn

from pianomime.errors import InputError
from pianomime.files import files_digest
from pianomime.learn.envs.checkpoint_callback import ResumableCallback
from pianomime.learn.envs.reference import load_score
from pianomime.learn.expert.ppo_model import Ppo, actor_network
from pianomime.learn.fingers.config import VALIDATION_SONGS, FingersConfig
from pianomime.learn.fingers.env import FingersVecEnv, PlannedSong
from pianomime.learn.imitation.export import export_network
from pianomime.learn.runs.log import RunLog
from pianomime.learn.runs.run import RunFolder
from pianomime.learn.runs.torch_threads import torch_threads
from pianomime.learn.runs.trainer import load_arrays
from pianomime.plan.demonstration import Demonstration, DemonstrationPlanner
from pianomime.players.player import PlannedPlayer
from pianomime.policies.finger_residual import ACTIONS, AGENTS, SIZE, FingerResidualTracker
from pianomime.policies.methods import FINGERS
from pianomime.policies.policy import PolicyInfo
from pianomime.progress import Progress, no_progress
from pianomime.songs.find import find_songs
from pianomime.track import DynamicTracker, Tracker
from pianomime.validation import within

_CHECKPOINT_UPDATES = 20
"""Updates between checkpoints."""


def train_fingers(
    folders: Sequence[Path],
    out: Path,
    config: FingersConfig,
    threads: int = 0,
    progress: Progress = no_progress,
) -> tuple[Path, dict[str, float]]:
    """Train the finger residual, or resume its training.

    Args:
        folders: of MIDI files; a few of these are kept for validation.
        out: folder; `fingers.onnx` is the result, and `fingers` holds the training.
        config: how to train it.
        threads: of the physics and of the network; 0 for one on each core.
        progress: called with the songs that are planned, the frames that were played, and the
            songs that it is evaluated on.

    Returns:
        The ONNX file, and the mean F1 on the validation songs: `validation/f1` with the residual
        (in full precision; the file has half), and `validation/f1_base` without.

    Raises:
        InputError: a song cannot be used, or the folder holds another training.
        OSError: a file cannot be read or written.
    """
    within("threads", threads, 0)
    # Each content once, by its digest: which are kept hardly depends on what else there is.
    contents = {files_digest([path]): path for path in find_songs(folders)}
    paths = [contents[digest] for digest in sorted(contents)]
    if len(paths) <= VALIDATION_SONGS:
        raise InputError(
            f"{VALIDATION_SONGS + 1} different songs at least are needed, {VALIDATION_SONGS} of "
            f"them for validation; there are {len(paths)}"
        )
    result = out / f"{FINGERS}.onnx"
    content = {**dataclasses.asdict(config), "data": files_digest(paths)[:16]}
    with RunFolder.open(out / FINGERS, FINGERS, content) as folder:
        if folder.has_result and result.exists():
            return result, folder.result()[1]
        songs = []
        progress("planning", 0, len(paths))
        for done, song in enumerate(paths, 1):
            songs.append(PlannedSong.of(load_score(song, 0.0, config.seconds)))
            progress("planning", done, len(paths))
        validation, train = songs[:VALIDATION_SONGS], songs[VALIDATION_SONGS:]
        env = FingersVecEnv(train, config, threads)
        model = _model(env, config)
        model.threads = threads or torch.get_num_threads()
        network = actor_network(model).eval()
        if folder.has_result:  # It was not exported.
            weights, metrics = folder.result()
            load_arrays(network, weights, folder.path)
        else:
            state = folder.state()
            since = 1 if state is None else state.steps + 1
            progress("training", (since - 1) // AGENTS, config.total_steps)
            with closing(RunLog(folder.tensorboard, since)) as log:
                callback = _Callback(folder, env, config, log, progress)
                model.set_logger(Logger(None, []))
                callback.learn(model, config.total_steps * AGENTS, state, folder.path)
            metrics = _evaluate(validation, network.eval(), progress)
        weights = {name: tensor.numpy().copy() for name, tensor in network.state_dict().items()}
        # A file of another training must not be taken for the result if the export fails.
        result.unlink(missing_ok=True)
        folder.keep_result(weights, metrics)
        info = PolicyInfo(FINGERS, "finger", "mlp", ACTIONS, residual=True, data=content["data"])
        example = {"observation": torch.zeros(2, SIZE)}
        export_network(_Actor(network), example, ["action"], info, result)
    return result, metrics


class _Actor(nn.Module):
    """The actor with a named input."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, observation: Tensor) -> Tensor:
        action: Tensor = self.network(observation)
        return action


def _model(env: FingersVecEnv, config: FingersConfig) -> Ppo:
    hidden = list(config.hidden)
    return Ppo(
        "MlpPolicy",
        env,
        learning_rate=lambda left: config.learning_rate * max(left, 0.0),
        n_steps=config.steps_per_update // config.num_envs,
        batch_size=config.batch_size,
        n_epochs=config.n_epochs,
        gamma=config.gamma,
        gae_lambda=config.gae_lambda,
        policy_kwargs={
            "net_arch": {"pi": hidden, "vf": hidden},
            "activation_fn": torch.nn.Tanh,
            "log_std_init": float(np.log(config.action_std)),
        },
        seed=config.seed,
        device="cpu",
    )


class _Callback(ResumableCallback):
    """Logs the reward of every update, and writes a checkpoint now and then."""

    def __init__(
        self,
        folder: RunFolder,
        env: FingersVecEnv,
        config: FingersConfig,
        log: RunLog,
        progress: Progress,
    ) -> None:
        super().__init__(env, config.seed, config.steps_per_update * AGENTS)
        self._folder, self._config = folder, config
        self._log, self._progress = log, progress

    def save(self, update: int, steps: int) -> None:
        """As `ResumableCallback.save`."""
        if update % _CHECKPOINT_UPDATES == 0 and update:
            self._folder.checkpoint(self.arrays(), steps)

    def _on_rollout_end(self) -> None:
        buffer = self.model.rollout_buffer  # type: ignore[attr-defined]
        reward = float(buffer.rewards.mean())
        self._log.add(self.model.num_timesteps, {"rollout/reward": reward})
        done = self.model.num_timesteps // AGENTS
        self._progress("training", done, self._config.total_steps, f"reward {reward:.4f}")


def _evaluate(songs: list[PlannedSong], network: nn.Module, progress: Progress) -> dict[str, float]:
    """Mean F1 of songs with the finger residual, and with the dynamic tracker alone."""

    def run(inputs: dict[str, NDArray[Any]]) -> list[NDArray[np.float32]]:
        with torch.inference_mode():
            return [network(torch.from_numpy(inputs["observation"])).numpy()]

    trackers: dict[str, Tracker] = {
        "validation/f1_base": DynamicTracker(),
        "validation/f1": FingerResidualTracker(run),
    }
    f1: dict[str, list[float]] = {name: [] for name in trackers}
    with torch_threads(1):
        for done, (name, song) in enumerate(product(trackers, songs)):
            progress("evaluating", done, len(trackers) * len(songs))
            f1[name].append(_f1(song.demonstration, trackers[name]))
    return {name: float(np.mean(values)) for name, values in f1.items()}


def _f1(song: Demonstration, tracker: Tracker) -> float:
    played = PlannedPlayer(FINGERS, DemonstrationPlanner(song), tracker).play(song.score)
    return float(played.metrics()["f1"])
