"""Training of the residual that all fingers share, from songs to the file that is played."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger

from pianomime.errors import InputError
from pianomime.generalist.fingers import SIZE, FingerTracker
from pianomime.learn.config_check import within
from pianomime.learn.fingers.config import FingersConfig, check_fingers
from pianomime.learn.fingers.fingers_env import FINGERS, FingersVecEnv, PlannedSong
from pianomime.learn.fit_folder import FitFolder
from pianomime.learn.generalist.export import export_network
from pianomime.learn.ppo_model import (
    Ppo,
    actor_network,
    model_arrays,
    resume_model,
    seed_update,
    torch_threads,
)
from pianomime.learn.run_lock import run_lock
from pianomime.learn.run_log import RunLog
from pianomime.learn.song import load_score
from pianomime.learn.tell import Tell
from pianomime.music import frame_metrics
from pianomime.song_files import find_songs
from pianomime.track import DynamicTracker, Tracker
from pianomime.world import World

STAGE = "fingers"
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
        The result, and the F1 on the songs that were kept, without and with it.

    Raises:
        InputError: the config or a song cannot be used, or the folder holds another training.
        OSError: a file cannot be read or written.
    """
    check_fingers(config)
    paths = find_songs(folders)
    within("number of songs", len(paths), _MEASURED + 1)
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes())
    about = {"stage": STAGE, **dataclasses.asdict(config), "data": digest.hexdigest()[:16]}
    path = out / STAGE
    path.mkdir(parents=True, exist_ok=True)
    result = out / f"{STAGE}.onnx"
    with run_lock(path):
        folder = FitFolder.open(path, about)
        if folder.finished and result.exists():
            return result, folder.weights()[1]
        songs = []
        for done, song in enumerate(paths, 1):
            songs.append(PlannedSong.of(load_score(song, 0.0, config.seconds)))
            if preparing is not None:
                preparing(done, len(paths), "")
        held = np.linspace(0, len(songs) - 1, _MEASURED).astype(int).tolist()
        learned = [song for number, song in enumerate(songs) if number not in held]
        env = FingersVecEnv(learned, config, threads)
        model = _model(env, config)
        model.threads = threads or torch.get_num_threads()
        with closing(RunLog(folder.tensorboard, 1)) as log:
            boundary = _Boundary(folder, env, config, log, tell)
            boundary.init_callback(model)
            model.set_logger(Logger(None, []))
            state = folder.state()
            if state is not None:
                boundary.resume(*state)
            model.learn(
                config.frames * FINGERS - model.num_timesteps,
                callback=boundary,
                reset_num_timesteps=state is None,
            )
        network = actor_network(model).eval()
        told = {"stage": STAGE, "level": "fingers"}
        export_network(network, (torch.zeros(2, SIZE),), ["told"], ["said"], told, result)
        measured = _measure([songs[number] for number in held], network)
        weights = {name: tensor.numpy().copy() for name, tensor in network.state_dict().items()}
        folder.finish(weights, measured)
    return result, measured


def _model(env: FingersVecEnv, config: FingersConfig) -> Ppo:
    steps = config.frames_per_update // config.worlds
    if steps < 1:
        raise InputError("frames-per-update must be worlds or more")
    hidden = list(config.hidden)
    return Ppo(
        "MlpPolicy",
        env,
        learning_rate=lambda left: config.learning_rate * max(left, 0.0),
        n_steps=steps,
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


class _Boundary(BaseCallback):
    """What happens between updates: tell, write a checkpoint, seed anew."""

    def __init__(
        self,
        folder: FitFolder,
        env: FingersVecEnv,
        config: FingersConfig,
        log: RunLog,
        tell: Tell | None,
    ) -> None:
        super().__init__()
        self._folder, self._env, self._config = folder, env, config
        self._log, self._tell = log, tell
        self._fresh = True

    def resume(self, arrays: dict[str, Any], steps: int) -> None:
        """Put model and worlds where a checkpoint has them."""
        self.model.num_timesteps = steps
        self._env.resume(resume_model(self.model, arrays, self._folder.path))
        self._fresh = False

    def _on_rollout_start(self) -> None:
        steps = self.model.num_timesteps
        update = steps // (self._config.frames_per_update * FINGERS)
        if self._fresh:
            self._env.set_state(self._env.state())
            if update % _CHECKPOINT == 0 and update:
                arrays = model_arrays(self.model)
                arrays |= {f"env/{name}": array for name, array in self._env.state().items()}
                self._folder.checkpoint(arrays, steps)
        self._fresh = True
        seed_update(self._config.seed, update)
        self._env.reseed(self._config.seed, update)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        buffer = self.model.rollout_buffer  # type: ignore[attr-defined]
        reward = float(buffer.rewards.mean())
        self._log.add(self.model.num_timesteps, {"fingers/reward": reward})
        if self._tell is not None:
            done = self.model.num_timesteps // FINGERS
            self._tell(done, self._config.frames, f"reward {reward:.4f}")


def _measure(songs: list[PlannedSong], network: torch.nn.Module) -> dict[str, float]:
    """Mean F1 of songs, with the dynamic tracker alone and with what it learned."""

    def run(given: dict[str, Any]) -> list[Any]:
        with torch.inference_mode():
            return [network(torch.from_numpy(given["told"])).numpy()]

    with torch_threads(1):
        return {
            name: float(np.mean([_f1(song, tracker) for song in songs]))
            for name, tracker in (
                ("unseen/f1_without", DynamicTracker()),
                ("unseen/f1", FingerTracker(run)),
            )
        }


def _f1(song: PlannedSong, tracker: Tracker) -> float:
    world = World(quiet=True)
    tracker.begin(song.plan)
    pressed = np.empty_like(song.goal)
    for frame in range(len(song.plan)):
        world.step(tracker.control(frame, world), bool(song.pedal[frame]))
        pressed[frame] = world.pressed
    return frame_metrics(song.goal, pressed).f1
