"""What the tests of learning share: a song of two notes, and settings that take a second."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import numpy as np
import pytest

from pianomime.learn.data.dataset import Dataset
from pianomime.learn.envs.config import EnvConfig, EpisodeConfig, ObservationConfig
from pianomime.learn.expert.config import ExpertConfig, PpoConfig, TrajectorySearchConfig
from pianomime.learn.runs import safetensors_file
from pianomime.music import Score
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.plan.demonstration import Demonstration
from pianomime.policies.features import rest_points

SMALL = PpoConfig(
    num_envs=4,
    steps_per_update=128,
    batch_size=64,
    n_epochs=2,
    hidden=(32, 16),
    learning_rate=1e-3,
)


@pytest.fixture(scope="session")
def two_notes() -> Demonstration:
    """One note for each hand, 1.5 s in all."""
    score = Score(
        key=np.array([30, 50]),
        onset=np.array([0.3, 0.8]),
        offset=np.array([0.7, 1.4]),
        velocity=np.array([80, 80]),
        pedal=np.array([[0.5, 1.0]]),
        title="two notes",
    )
    return Demonstration(score, ZeroShotPlanner().plan(score), source="made up")


@pytest.fixture(scope="session")
def shallow(two_notes: Demonstration) -> Demonstration:
    """The same with a plan whose fingers stop short: the base controller presses nothing."""
    fingertips = two_notes.plan.fingertips.copy()
    fingertips[:, :, 1:, 2][two_notes.plan.finger_key >= 0] = 0.03
    plan = FingertipPlan(
        fingertips,
        two_notes.plan.finger_key,
        two_notes.plan.note_hand,
        two_notes.plan.note_finger,
    )
    return dataclasses.replace(two_notes, plan=plan)


@pytest.fixture
def small_ppo() -> ExpertConfig:
    """Three updates of a small network."""
    return ExpertConfig(method="ppo", total_steps=384, ppo=SMALL)


@pytest.fixture
def small_search() -> ExpertConfig:
    """A few passes that try little."""
    search = TrajectorySearchConfig(variations=4, rounds=1, ahead=6)
    return ExpertConfig(method="search", total_steps=600, env=EnvConfig(base="ik"), search=search)


@pytest.fixture
def every_term() -> EnvConfig:
    """All terms of an observation, episodes that begin anywhere and are truncated."""
    seen = ObservationConfig(goal=3, fingertips=2, errors=True, time=True)
    return EnvConfig(observation=seen, episode=EpisodeConfig(start="anywhere", frames=7))


@pytest.fixture
def full_disk(monkeypatch: pytest.MonkeyPatch) -> Callable[[], AbstractContextManager[None]]:
    """As a context: whatever checkpoint is written in it breaks off half way, as on a full disk."""

    def full(path: Path, content: bytes) -> int:
        with open(path, "wb") as file:
            file.write(content[: len(content) // 2])
        raise OSError(28, "No space left on device", str(path))

    @contextmanager
    def disk() -> Iterator[None]:
        with monkeypatch.context() as patch:
            patch.setattr(safetensors_file.Path, "write_bytes", full)
            with pytest.raises(OSError, match="No space left"):
                yield

    return disk


@pytest.fixture
def clips() -> Dataset:
    """Three clips of 30, 7 and 20 frames, the first two of one song; every frame is another."""
    draw = np.random.default_rng(0)
    frames = 57
    goal = np.zeros((frames, 88), bool)
    goal[np.arange(frames), 20 + np.arange(frames) % 40] = True
    return Dataset(
        {
            "goal": goal,
            "fingertips": (rest_points() + draw.normal(0, 0.02, (frames, 2, 6, 3))).astype("f4"),
            "joints": draw.normal(0, 0.1, (frames, 54)).astype("f4"),
            "velocities": draw.normal(0, 1, (frames, 54)).astype("f4"),
            "keys": np.where(goal, 0.5, 0.0).astype("f4"),
            "base_control": draw.normal(0, 0.1, (frames, 46)).astype("f4"),
            "action": draw.normal(0, 0.1, (frames, 46)).astype("f4"),
        },
        np.array([30, 37, 57]),
        np.array([4, 4, 9]),
        ["a", "b", "c"],
    )
