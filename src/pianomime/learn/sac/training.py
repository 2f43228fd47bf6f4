"""Training of the policy that learns all songs by trying, from songs to the file that is played."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import SAC
from stable_baselines3.common.logger import Logger
from torch import Tensor, nn

from pianomime.errors import InputError
from pianomime.keyboard import KEYS
from pianomime.learn.envs.checkpoint_callback import ResumableCallback
from pianomime.learn.envs.reference import load_score
from pianomime.learn.envs.reward import press_reward
from pianomime.learn.envs.sb3_multi_song import Played, Sb3MultiSongEnv
from pianomime.learn.imitation.export import export_network
from pianomime.learn.imitation.normalizer import Scale
from pianomime.learn.runs.fit_folder import FitFolder
from pianomime.learn.runs.log import RunLog
from pianomime.learn.runs.safetensors_file import Arrays
from pianomime.learn.runs.stage_folder import stage_folder
from pianomime.learn.runs.tell import Tell
from pianomime.learn.runs.validation import within
from pianomime.learn.sac.config import SacConfig, check_sac
from pianomime.music import Score
from pianomime.policies.features import CONTROLS, TIPS, holding, low_inputs
from pianomime.policies.horizon import CHUNK
from pianomime.songs.find import find_songs
from pianomime.world.hand import by_actuator, hand_points

STAGE = "multi-task-sac"
STEPS = by_actuator(finger=0.3, wrist=0.3, slide=0.06)
"""(46,) [rad, m] that an action of 1 sends an actuator away from where it is."""
_SCALED_BY = 64
"""Frames, in all worlds, from which the scale of what is seen is taken."""
_CHECKPOINT = 50_000
"""Frames between checkpoints, about; all that is remembered is in them."""
_REMEMBERED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
_VECTOR = 108 + KEYS + TIPS
_HIT = 0.5


@dataclass(frozen=True, eq=False)
class AskedSong:
    """A song, of which nothing is known but what it asks for.

    Attributes:
        goal: (T, 88) bool.
        pedal: (T,) bool.
    """

    goal: NDArray[np.bool_]
    pedal: NDArray[np.bool_]

    @classmethod
    def of(cls, score: Score) -> AskedSong:
        """What a score asks for."""
        return cls(score.roll(), score.pedal_roll())


class SacVecEnv(Sb3MultiSongEnv):
    """Both hands of a world are one agent, which sees what a policy of one stage sees.

    Attributes:
        scale: brings what is seen to a common size, once it is known.

    Args:
        songs: what is played.
        config: how.
        threads: how many worlds step at the same time; 0 for one on each core.
    """

    def __init__(self, songs: Sequence[AskedSong], config: SacConfig, threads: int = 0) -> None:
        silence = np.zeros((CHUNK, KEYS), bool)
        self.scale: Scale | None = None
        self._goals = [np.vstack([song.goal, silence]) for song in songs]
        self._holding = np.zeros((config.worlds, CONTROLS))
        super().__init__(songs, config.worlds, 1, CHUNK * KEYS + _VECTOR, CONTROLS, threads)

    def see(self) -> NDArray[np.float32]:
        """As `Sb3MultiSongEnv.see`."""
        joints = self.worlds.qpos_hands
        self._holding = holding(joints)
        goal = np.array([self._goals[song][at : at + CHUNK] for song, at in self.rows.tolist()])
        keys, velocities = self.worlds.key_state, self.worlds.qvel_hands
        seen = low_inputs(goal, None, hand_points(joints), joints, velocities, keys, None)
        told = np.concatenate([seen["goal"].reshape(len(joints), -1), seen["vector"]], axis=1)
        if self.scale is not None:
            told = self.scale(torch.from_numpy(told)).numpy()
        return told[:, None]

    def controls(self, said: NDArray[Any]) -> NDArray[np.float64]:
        """As `Sb3MultiSongEnv.controls`."""
        ctrl: NDArray[np.float64] = self._holding + STEPS * said[:, 0]
        return ctrl

    def rewards(self, played: Played, said: NDArray[Any]) -> NDArray[np.float64]:
        """As `Sb3MultiSongEnv.rewards`: the paper's for keys; there are no fingertips to mimic."""
        reward = press_reward(played.key_state, played.pressed, played.wanted, _HIT)
        return reward[:, None]


class _Actor(nn.Module):
    """The mean of what an actor does, as a policy of one stage is asked for it."""

    steps: Tensor

    def __init__(self, scale: Scale, actor: Any) -> None:
        super().__init__()
        self.scale, self.body, self.mean = scale, actor.latent_pi, actor.mu
        self.register_buffer("steps", torch.from_numpy(STEPS).float())

    def forward(self, goal: Tensor, vector: Tensor) -> Tensor:
        """(B, 1, 46) what is added to the controls that hold the pose."""
        told = torch.cat([goal.flatten(1), vector], dim=1)
        said = torch.tanh(self.mean(self.body(self.scale(told))))
        return (self.steps * said)[:, None]


def train_sac(
    folders: Sequence[Path],
    out: Path,
    config: SacConfig,
    threads: int = 0,
    tell: Tell | None = None,
) -> Path:
    """Train, or go on where its training was; the result is `multi-task-sac.onnx` in the folder.

    Args:
        folders: of MIDI files.
        out: folder.
        config: how.
        threads: of the physics; 0 for one on each core.
        tell: told how far it is.

    Raises:
        InputError: the config or a song cannot be used, or the folder holds another training.
        OSError: a file cannot be read or written.
    """
    check_sac(config)
    within("threads", threads, 0)
    paths = find_songs(folders)
    with stage_folder(out, STAGE, config, paths) as (folder, result):
        if folder.finished and result.exists():
            return result
        songs = [AskedSong.of(load_score(path, 0.0, config.seconds)) for path in paths]
        env = SacVecEnv(songs, config, threads)
        scale = env.scale = _scale(env, config.seed)
        model = SAC(
            "MlpPolicy",
            env,
            learning_rate=config.learning_rate,
            buffer_size=config.buffer,
            learning_starts=config.first,
            batch_size=config.batch,
            gamma=config.discount,
            gradient_steps=config.updates,
            policy_kwargs={"net_arch": list(config.hidden)},
            seed=config.seed,
            device="cpu",
        )
        model.set_logger(Logger(None, []))
        state = folder.state()
        since = 1 if state is None else state[1] + 1
        with closing(RunLog(folder.tensorboard, since)) as log:
            boundary = _Boundary(folder, env, config, log, tell)
            boundary.learn(model, config.frames, state, folder.path)
        actor = _Actor(scale, model.policy.actor).eval()
        about = {
            "stage": STAGE,
            "level": "whole",
            "prior": False,
            "network": "mlp",
            "chunk": 1,
            "width": CONTROLS,
        }
        given = (torch.zeros(2, CHUNK, KEYS), torch.zeros(2, _VECTOR))
        weights = {name: tensor.numpy().copy() for name, tensor in actor.state_dict().items()}
        # One of another training is not to be taken for this one if the export fails.
        result.unlink(missing_ok=True)
        folder.finish(weights, {})
        export_network(actor, given, ["goal", "vector"], ["said"], about, result)
    return result


class _Boundary(ResumableCallback):
    """Tells how far it is and how much reward there was, and writes a checkpoint now and then."""

    def __init__(
        self,
        folder: FitFolder,
        env: SacVecEnv,
        config: SacConfig,
        log: RunLog,
        tell: Tell | None,
    ) -> None:
        # Whole frames of all worlds.
        super().__init__(env, config.seed, -(-_CHECKPOINT // config.worlds) * config.worlds)
        self._folder, self._config = folder, config
        self._log, self._tell = log, tell
        self._rewards: list[float] = []

    @property
    def _learner(self) -> SAC:
        assert isinstance(self.model, SAC)
        return self.model

    def arrays(self) -> Arrays:
        """As `ResumableCallback.arrays`, with all frames that are remembered."""
        model, kept = self._learner, self._learner.replay_buffer
        assert kept is not None
        assert model.log_ent_coef is not None
        arrays = super().arrays()
        for name in _REMEMBERED:
            whole = getattr(kept, name)
            arrays[f"buffer/{name}"] = whole if kept.full else whole[: kept.pos]
        return arrays | {
            "buffer/next": np.array(kept.pos),
            "temperature/log": model.log_ent_coef.detach().numpy(),
        }

    def optimizers(self) -> dict[str, torch.optim.Optimizer]:
        """As `ResumableCallback.optimizers`."""
        model = self._learner
        assert model.ent_coef_optimizer is not None
        return {
            "actor": model.actor.optimizer,
            "critic": model.critic.optimizer,
            "entropy": model.ent_coef_optimizer,
        }

    def resume(self, arrays: Arrays, steps: int, path: Path) -> None:
        """As `ResumableCallback.resume`."""
        super().resume(arrays, steps, path)
        model, kept = self._learner, self._learner.replay_buffer
        assert kept is not None
        assert model.log_ent_coef is not None
        try:
            for name in _REMEMBERED:
                rows = arrays[f"buffer/{name}"]
                getattr(kept, name)[: len(rows)] = rows
            kept.pos = int(arrays["buffer/next"])
            model.log_ent_coef.data.copy_(torch.from_numpy(arrays["temperature/log"]))
        except (LookupError, ValueError, RuntimeError) as error:
            raise InputError(f"{path}: the checkpoint does not fit the config") from error
        kept.full = len(rows) == kept.buffer_size

    def keep(self, update: int, steps: int) -> None:
        """As `ResumableCallback.keep`."""
        self._rewards = []
        if update:
            self._folder.checkpoint(self.arrays(), steps)

    def _on_rollout_start(self) -> None:
        # For SAC every frame is a rollout of its own.
        if self.model.num_timesteps % self._steps_per_update == 0:
            self.between_updates()

    def _on_step(self) -> bool:
        self._rewards.append(float(self.locals["rewards"].mean()))
        if len(self._rewards) == 200:
            mean = float(np.mean(self._rewards))
            self._rewards = []
            self._log.add(self.num_timesteps, {"sac/reward": mean})
            if self._tell is not None:
                done = min(self.num_timesteps, self._config.frames)
                self._tell(done, self._config.frames, f"reward {mean:.3f}")
        return True


def _scale(env: SacVecEnv, seed: int) -> Scale:
    """What is usual, of worlds in which something is done by chance."""
    draw = np.random.default_rng(seed)
    env.reset()
    shape = (env.num_envs, CONTROLS)
    seen = [np.asarray(env.play(draw.uniform(-1, 1, shape))[0]) for _ in range(_SCALED_BY)]
    scale = Scale(CHUNK * KEYS + _VECTOR)
    scale.fit(np.concatenate(seen))
    # Keys that nobody happened to want are not unlike others.
    scale.middle[: CHUNK * KEYS], scale.spread[: CHUNK * KEYS] = 0.0, 1.0
    return scale
