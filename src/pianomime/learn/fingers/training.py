"""Training of the residual that all fingers share, from songs to the file that is played."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.logger import Logger

from pianomime.learn.envs.checkpoint_callback import ResumableCallback
from pianomime.learn.envs.reference import load_score
from pianomime.learn.expert.ppo_model import Ppo, actor_network
from pianomime.learn.fingers.config import FingersConfig, check_fingers
from pianomime.learn.fingers.env import AGENTS, FingersVecEnv, PlannedSong
from pianomime.learn.imitation.export import export_network
from pianomime.learn.runs.fit_folder import FitFolder
from pianomime.learn.runs.log import RunLog
from pianomime.learn.runs.stage_folder import stage_folder
from pianomime.learn.runs.tell import Tell
from pianomime.learn.runs.torch_threads import torch_threads
from pianomime.learn.runs.validation import within
from pianomime.plan.demonstration import Demonstration, DemonstrationPlanner
from pianomime.players.player import Player
from pianomime.policies.finger_residual import SIZE, FingerResidualTracker
from pianomime.policies.methods import FINGERS
from pianomime.songs.find import find_songs
from pianomime.track import DynamicTracker, Tracker

_MEASURED = 8
"""Songs that are kept from training, by which it is seen how well it goes."""
_CHECKPOINT = 20
"""Updates between checkpoints."""


def train_fingers(
    folders: Sequence[Path],
    out: Path,
    config: FingersConfig,
    threads: int = 0,
    tell: Tell | None = None,
    preparing: Tell | None = None,
) -> tuple[Path, dict[str, float]]:
    """Train, or go on where its training was.

    Args:
        folders: of MIDI files; a few are kept to measure on.
        out: folder; `fingers.onnx` is the result, and `fingers` holds the training.
        config: how.
        threads: of the physics and of the network; 0 for one on each core.
        tell: told how far it is.
        preparing: told how many songs are planned.

    Returns:
        The result, and the F1 on the songs that were kept, without and with it (before the file
        keeps half of its digits).

    Raises:
        InputError: the config or a song cannot be used, or the folder holds another training.
        OSError: a file cannot be read or written.
    """
    check_fingers(config)
    within("threads", threads, 0)
    # Each content once, by its digest: which are kept hardly depends on what else there is.
    contents = {hashlib.sha256(path.read_bytes()).hexdigest(): path for path in find_songs(folders)}
    paths = [contents[digest] for digest in sorted(contents)]
    within("number of songs", len(paths), _MEASURED + 1)
    with stage_folder(out, FINGERS, config, paths) as (folder, result):
        if folder.finished and result.exists():
            return result, folder.weights()[1]
        songs = []
        for done, song in enumerate(paths, 1):
            songs.append(PlannedSong.of(load_score(song, 0.0, config.seconds)))
            if preparing is not None:
                preparing(done, len(paths), "")
        held, learned = songs[:_MEASURED], songs[_MEASURED:]
        env = FingersVecEnv(learned, config, threads)
        model = _model(env, config)
        model.threads = threads or torch.get_num_threads()
        state = folder.state()
        since = 1 if state is None else state[1] + 1
        with closing(RunLog(folder.tensorboard, since)) as log:
            boundary = _Boundary(folder, env, config, log, tell)
            model.set_logger(Logger(None, []))
            boundary.learn(model, config.frames * AGENTS, state, folder.path)
        network = actor_network(model).eval()
        measured = _measure(held, network)
        weights = {name: tensor.numpy().copy() for name, tensor in network.state_dict().items()}
        # One of another training is not to be taken for this one if the export fails.
        result.unlink(missing_ok=True)
        folder.finish(weights, measured)
        told = {"stage": FINGERS, "level": "fingers"}
        export_network(network, (torch.zeros(2, SIZE),), ["told"], ["said"], told, result)
    return result, measured


def _model(env: FingersVecEnv, config: FingersConfig) -> Ppo:
    hidden = list(config.hidden)
    return Ppo(
        "MlpPolicy",
        env,
        learning_rate=lambda left: config.learning_rate * max(left, 0.0),
        n_steps=config.frames_per_update // config.worlds,
        batch_size=config.batch,
        n_epochs=config.epochs,
        gamma=config.discount,
        gae_lambda=config.gae,
        policy_kwargs={
            "net_arch": {"pi": hidden, "vf": hidden},
            "activation_fn": torch.nn.Tanh,
            "log_std_init": float(np.log(config.noise)),
        },
        seed=config.seed,
        device="cpu",
    )


class _Boundary(ResumableCallback):
    """Tells, and writes a checkpoint every now and then."""

    def __init__(
        self,
        folder: FitFolder,
        env: FingersVecEnv,
        config: FingersConfig,
        log: RunLog,
        tell: Tell | None,
    ) -> None:
        super().__init__(env, config.seed, config.frames_per_update * AGENTS)
        self._folder, self._config = folder, config
        self._log, self._tell = log, tell

    def keep(self, update: int, steps: int) -> None:
        """As `ResumableCallback.keep`."""
        if update % _CHECKPOINT == 0 and update:
            self._folder.checkpoint(self.arrays(), steps)

    def _on_rollout_end(self) -> None:
        buffer = self.model.rollout_buffer  # type: ignore[attr-defined]
        reward = float(buffer.rewards.mean())
        self._log.add(self.model.num_timesteps, {"fingers/reward": reward})
        if self._tell is not None:
            done = self.model.num_timesteps // AGENTS
            self._tell(done, self._config.frames, f"reward {reward:.4f}")


def _measure(songs: list[PlannedSong], network: torch.nn.Module) -> dict[str, float]:
    """Mean F1 of songs, with the dynamic tracker alone and with what it learned."""

    def run(given: dict[str, Any]) -> list[Any]:
        with torch.inference_mode():
            return [network(torch.from_numpy(given["told"])).numpy()]

    with torch_threads(1):
        return {
            name: float(np.mean([_f1(song.demonstration, tracker) for song in songs]))
            for name, tracker in (
                ("unseen/f1_without", DynamicTracker()),
                ("unseen/f1", FingerResidualTracker(run)),
            )
        }


def _f1(song: Demonstration, tracker: Tracker) -> float:
    played = Player(FINGERS, DemonstrationPlanner(song), tracker).play(song.score)
    return float(played.metrics()["f1"])
