"""Training of multi-task SAC, from MIDI files to the file that is played."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from sb3_contrib import TQC
from stable_baselines3 import SAC
from stable_baselines3.common.logger import Logger
from torch import Tensor, nn

from pianomime.errors import InputError
from pianomime.files import files_digest
from pianomime.keyboard import KEYS
from pianomime.learn.envs.checkpoint_callback import ResumableCallback
from pianomime.learn.envs.reference import load_score
from pianomime.learn.envs.reward import press_reward, reach_reward
from pianomime.learn.envs.sb3_multi_song import PlayedFrame, Sb3MultiSongEnv
from pianomime.learn.imitation.export import export_network
from pianomime.learn.imitation.normalizer import StandardNormalizer
from pianomime.learn.runs.log import RunLog
from pianomime.learn.runs.run import RunFolder
from pianomime.learn.runs.safetensors_file import Arrays
from pianomime.learn.runs.trainer import load_arrays
from pianomime.learn.sac.config import Algorithm, SacConfig
from pianomime.music import Score
from pianomime.policies.features import holding_controls, tracking_observation
from pianomime.policies.horizon import CHUNK
from pianomime.policies.policy import PolicyInfo
from pianomime.progress import Progress, no_progress
from pianomime.short_repr import short_repr
from pianomime.songs.find import find_songs
from pianomime.validation import within
from pianomime.world.hand import by_actuator, hand_points
from pianomime.world.layout import LAYOUT, POINTS_SIZE

NAME = "multi-task-sac"
ACTION_SCALE = by_actuator(finger=0.3, wrist=0.3, slide=0.06)
"""(46,) [rad, m] added for an action of 1 to the control that holds the present pose."""
_NORMALIZER_STEPS = 64
"""Control steps, in all environments, that the normalizer of observations is fitted to."""
_ALGORITHMS: dict[Algorithm, type[SAC] | type[TQC]] = {"sac": SAC, "tqc": TQC}
_CHECKPOINT_STEPS = 50_000
"""Control steps between checkpoints, about; the whole replay buffer is in them."""
_LOG_STEPS = 200
"""Control steps of all environments whose mean reward is logged."""
_BUFFER = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
_GOAL_SIZE = CHUNK * KEYS
_VECTOR_SIZE = 2 * LAYOUT.hands_size + KEYS + POINTS_SIZE


@dataclass(frozen=True, eq=False)
class GoalSong:
    """A song without fingertips: goals and pedal alone.

    Attributes:
        goal: (T, 88) bool, keys that should sound.
        pedal: (T,) bool, the pedal of the score.
    """

    goal: NDArray[np.bool_]
    pedal: NDArray[np.bool_]

    __repr__ = short_repr

    @classmethod
    def of(cls, score: Score) -> GoalSong:
        """The frames of a score."""
        return cls(score.roll(), score.pedal_roll())


class SacVecEnv(Sb3MultiSongEnv):
    """One agent in each world, with the observation of an end-to-end policy, flattened.

    Attributes:
        normalizer: of the observations; None before it is fitted.

    Args:
        songs: songs to play.
        config: number of worlds, and the reward.
        threads: how many worlds step at the same time; 0 for one on each core.
    """

    def __init__(self, songs: Sequence[GoalSong], config: SacConfig, threads: int = 0) -> None:
        silence = np.zeros((CHUNK, KEYS), bool)
        self.normalizer: StandardNormalizer | None = None
        self._goals = [np.vstack([song.goal, silence]) for song in songs]
        self._hit, self._reach = config.hit, config.reach
        self._holding = np.zeros((config.num_envs, LAYOUT.ctrl_size))
        super().__init__(
            songs, config.num_envs, 1, _GOAL_SIZE + _VECTOR_SIZE, LAYOUT.ctrl_size, threads
        )

    def agent_observations(self) -> NDArray[np.float32]:
        """As `Sb3MultiSongEnv.agent_observations`."""
        joints = self.worlds.qpos_hands
        self._holding = holding_controls(joints)
        goal = np.array([self._goals[song][at : at + CHUNK] for song, at in self.rows.tolist()])
        keys, velocities = self.worlds.key_state, self.worlds.qvel_hands
        parts = tracking_observation(
            goal, None, hand_points(joints), joints, velocities, keys, None
        )
        flat = np.concatenate([parts["goal"].reshape(len(joints), -1), parts["vector"]], axis=1)
        if self.normalizer is not None:
            flat = self.normalizer(torch.from_numpy(flat)).numpy()
        return flat[:, None]

    def controls(self, actions: NDArray[Any]) -> NDArray[np.float64]:
        """As `Sb3MultiSongEnv.controls`."""
        ctrl: NDArray[np.float64] = self._holding + ACTION_SCALE * actions[:, 0]
        return ctrl

    def rewards(self, played: PlayedFrame, actions: NDArray[Any]) -> NDArray[np.float64]:
        """As `Sb3MultiSongEnv.rewards`: the paper's press term; there are no targets to mimic."""
        reward = press_reward(played.key_state, played.pressed, played.goal, self._hit)
        if self._reach:
            tips = hand_points(self.worlds.qpos_hands)[:, :, 1:]
            reward += self._reach * reach_reward(tips, played.goal)
        return reward[:, None]


class _Actor(nn.Module):
    """The mean action of SAC or TQC, with the inputs and output of an end-to-end policy."""

    action_scale: Tensor

    def __init__(self, normalizer: StandardNormalizer, actor: Any) -> None:
        super().__init__()
        self.normalizer, self.body, self.mean = normalizer, actor.latent_pi, actor.mu
        self.register_buffer("action_scale", torch.from_numpy(ACTION_SCALE).float())

    def forward(self, goal: Tensor, vector: Tensor) -> Tensor:
        """(B, 1, 46) [rad, m] relative to the controls that hold the present pose."""
        flat = torch.cat([goal.flatten(1), vector], dim=1)
        action = torch.tanh(self.mean(self.body(self.normalizer(flat))))
        return (self.action_scale * action)[:, None]


def train_sac(
    folders: Sequence[Path],
    out: Path,
    config: SacConfig,
    threads: int = 0,
    progress: Progress = no_progress,
) -> Path:
    """Train multi-task SAC, or resume its training.

    Args:
        folders: of MIDI files.
        out: folder; `multi-task-sac.onnx` is the result, `multi-task-sac` holds the training.
        config: how to train it.
        threads: of the physics; 0 for one on each core.
        progress: called with the frames that were played.

    Raises:
        InputError: a song cannot be used, or the folder holds another training.
        OSError: a file cannot be read or written.
    """
    within("threads", threads, 0)
    paths = find_songs(folders)
    result = out / f"{NAME}.onnx"
    content = {**dataclasses.asdict(config), "data": files_digest(paths)[:16]}
    with RunFolder.open(out / NAME, "sac", content) as folder:
        if folder.has_result and result.exists():
            return result
        progress("reading", 0, 0)
        songs = [GoalSong.of(load_score(path, 0.0, config.seconds)) for path in paths]
        env = SacVecEnv(songs, config, threads)
        normalizer = env.normalizer = _fit_normalizer(env, config.seed)
        model = _ALGORITHMS[config.algorithm](
            "MlpPolicy",
            env,
            learning_rate=config.learning_rate,
            buffer_size=config.buffer_size,
            learning_starts=config.learning_starts,
            batch_size=config.batch_size,
            gamma=config.gamma,
            gradient_steps=config.gradient_steps,
            policy_kwargs={"net_arch": list(config.hidden)},
            seed=config.seed,
            device="cpu",
        )
        actor = _Actor(normalizer, model.policy.actor).eval()
        if folder.has_result:  # It was not exported.
            load_arrays(actor, folder.result()[0], folder.path)
        else:
            model.set_logger(Logger(None, []))
            state = folder.state()
            since = 1 if state is None else state.steps + 1
            progress("training", since - 1, config.total_steps)
            with closing(RunLog(folder.tensorboard, since)) as log:
                callback = _Callback(folder, env, config, log, progress)
                callback.learn(model, config.total_steps, state, folder.path)
            actor.eval()
        info = PolicyInfo(NAME, "end-to-end", "mlp", LAYOUT.ctrl_size, data=content["data"])
        example = {
            "goal": torch.zeros(2, CHUNK, KEYS),
            "vector": torch.zeros(2, _VECTOR_SIZE),
        }
        # A file of another training must not be taken for the result if the export fails.
        result.unlink(missing_ok=True)
        weights = {name: tensor.numpy().copy() for name, tensor in actor.state_dict().items()}
        folder.keep_result(weights, {})
        export_network(actor, example, ["action"], info, result)
    return result


class _Callback(ResumableCallback):
    """Logs the reward, and writes a checkpoint now and then."""

    def __init__(
        self,
        folder: RunFolder,
        env: SacVecEnv,
        config: SacConfig,
        log: RunLog,
        progress: Progress,
    ) -> None:
        # A multiple of the number of environments.
        steps = -(-_CHECKPOINT_STEPS // config.num_envs) * config.num_envs
        super().__init__(env, config.seed, steps)
        self._folder, self._config = folder, config
        self._log, self._progress = log, progress
        self._rewards: list[float] = []

    @property
    def _learner(self) -> SAC | TQC:
        assert isinstance(self.model, SAC | TQC)
        return self.model

    def arrays(self) -> Arrays:
        """As `ResumableCallback.arrays`, with the replay buffer."""
        model, buffer = self._learner, self._learner.replay_buffer
        assert buffer is not None
        assert model.log_ent_coef is not None
        arrays = super().arrays()
        for name in _BUFFER:
            whole = getattr(buffer, name)
            arrays[f"buffer/{name}"] = whole if buffer.full else whole[: buffer.pos]
        return arrays | {
            "buffer/next": np.array(buffer.pos),
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
        model, buffer = self._learner, self._learner.replay_buffer
        assert buffer is not None
        assert model.log_ent_coef is not None
        try:
            for name in _BUFFER:
                rows = arrays[f"buffer/{name}"]
                getattr(buffer, name)[: len(rows)] = rows
            buffer.pos = int(arrays["buffer/next"])
            model.log_ent_coef.data.copy_(torch.from_numpy(arrays["temperature/log"]))
        except (LookupError, ValueError, TypeError, RuntimeError) as error:
            raise InputError(f"{path}: the checkpoint does not fit the config") from error
        buffer.full = len(rows) == buffer.buffer_size

    def save(self, update: int, steps: int) -> None:
        """As `ResumableCallback.save`."""
        self._rewards = []
        if update:
            self._folder.checkpoint(self.arrays(), steps)

    def _on_rollout_start(self) -> None:
        # In SAC every control step is a rollout of its own.
        if self.model.num_timesteps % self._steps_per_update == 0:
            self.between_updates()

    def _on_step(self) -> bool:
        self._rewards.append(float(self.locals["rewards"].mean()))
        if len(self._rewards) == _LOG_STEPS:
            mean = float(np.mean(self._rewards))
            self._rewards = []
            self._log.add(self.num_timesteps, {"rollout/reward": mean})
            done = min(self.num_timesteps, self._config.total_steps)
            self._progress("training", done, self._config.total_steps, f"reward {mean:.3f}")
        return True


def _fit_normalizer(env: SacVecEnv, seed: int) -> StandardNormalizer:
    """The normalizer of observations, fitted to a rollout of random actions."""
    rng = np.random.default_rng(seed)
    env.reset()
    shape = (env.num_envs, LAYOUT.ctrl_size)
    observations = [
        np.asarray(env.step_frame(rng.uniform(-1, 1, shape))[0]) for _ in range(_NORMALIZER_STEPS)
    ]
    normalizer = StandardNormalizer(_GOAL_SIZE + _VECTOR_SIZE)
    normalizer.fit(np.concatenate(observations))
    # Goals stay as they are: keys that did not occur in these songs are like all others.
    normalizer.mean[:_GOAL_SIZE], normalizer.std[:_GOAL_SIZE] = 0.0, 1.0
    return normalizer
