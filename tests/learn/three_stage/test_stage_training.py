"""Training of the three stages, and what they learn from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pianomime import load_player
from pianomime.errors import InputError
from pianomime.learn.data.dataset import TRAJECTORY_COLUMNS, Dataset, trajectory_dataset
from pianomime.learn.data.episode import COLUMNS, Episode
from pianomime.learn.data.trajectories import write_trajectories
from pianomime.learn.runs.trainer_config import TrainerConfig
from pianomime.learn.three_stage.config import STAGES, StageConfig
from pianomime.learn.three_stage.fingering_samples import FingeringSamples
from pianomime.learn.three_stage.hand_samples import ControlsSamples, MotionSamples
from pianomime.learn.three_stage.training import train_stage
from pianomime.plan.demonstration import Demonstration
from pianomime.policies.three_stage.fingering import NOBODY
from pianomime.policies.three_stage.hand_controls import controls_of_action
from pianomime.policies.three_stage.hand_motion import points_of_action
from pianomime.progress import no_progress
from pianomime.world.layout import LAYOUT

SHORT = StageConfig(hidden=(32, 32), trainer=TrainerConfig(steps=6, batch=16, warmup=1))


@pytest.fixture(scope="module")
def data(two_notes: Demonstration, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fifteen songs that are one."""
    draw = np.random.default_rng(0)
    frames = len(two_notes.plan)
    columns = {
        name: draw.normal(0, 0.1, (frames, *column.shape)).astype(column.dtype)
        for name, column in COLUMNS.items()
    }
    columns["goal"] = two_notes.score.roll()
    columns["fingertips"] = two_notes.plan.fingertips.astype(np.float32)
    columns["finger_key"] = two_notes.plan.finger_key
    columns["keys"] = columns["goal"].astype(np.float32)
    folder = tmp_path_factory.mktemp("data") / "songs.zarr"
    episodes = (Episode(str(number), 1.0, "ik", columns, number) for number in range(15))
    write_trajectories(folder, episodes)
    return folder


@pytest.fixture(scope="module")
def dataset(data: Path) -> Dataset:
    return trajectory_dataset([data], TRAJECTORY_COLUMNS)


def test_what_was_trained_plays(data, two_notes, tmp_path):
    for stage in STAGES:
        assert train_stage(stage, SHORT, tmp_path, [data]) == tmp_path / f"{stage}.onnx"
    player = load_player("three-stage", 0, weights=tmp_path)
    first, again = (player.play(two_notes.score) for _ in range(2))
    assert np.isfinite(first.ctrl).all()
    np.testing.assert_array_equal(first.ctrl, again.ctrl)


@pytest.mark.parametrize("stage", STAGES)
def test_a_training_goes_on_to_the_same_weights(data, tmp_path, stage):
    config = replace(SHORT, trainer=replace(SHORT.trainer, checkpoint_seconds=0.0))

    def stop(phase: str, done: int, total: int, remark: str = "") -> None:
        if phase == "training" and done >= 3:
            raise KeyboardInterrupt

    whole = train_stage(stage, config, tmp_path / "whole", [data]).read_bytes()
    with pytest.raises(KeyboardInterrupt):
        train_stage(stage, config, tmp_path / "parts", [data], stop)
    assert not (tmp_path / "parts" / f"{stage}.onnx").exists()
    assert train_stage(stage, config, tmp_path / "parts", [data]).read_bytes() == whole
    other = replace(config, hidden=(16,))
    with pytest.raises(InputError, match="hidden"):
        train_stage(stage, other, tmp_path / "parts", [data], no_progress)


def test_fingering_learns_a_song_that_never_changes(data, two_notes, tmp_path):
    """And then says the fingers of the data."""
    config = replace(SHORT, trainer=TrainerConfig(steps=200, batch=64, learning_rate=3e-3))
    for stage in STAGES:
        train_stage(stage, config if stage == "fingering" else SHORT, tmp_path, [data])
    performance = load_player("three-stage", 0, weights=tmp_path).play(two_notes.score)
    np.testing.assert_array_equal(performance.plan.finger_key, two_notes.plan.finger_key)


def test_choices_are_those_of_the_data(dataset, two_notes):
    samples = FingeringSamples.of(dataset)
    keys = two_notes.plan.finger_key.reshape(-1, 10)
    for row, key, choice in zip(samples.row, samples.key, samples.choice, strict=True):
        assert samples.goal[row, key]
        assert choice != NOBODY
    # Half of the samples are mirrored; of the others the first is that of the first note.
    assert samples.choice[0] == np.flatnonzero(keys[samples.row[0] - 1] >= 0)[0]


def test_without_noise_motion_is_that_of_the_data(dataset):
    sample = MotionSamples(dataset).evenly(2 * int(dataset.ends[0]))
    tips = dataset.columns["fingertips"]
    rows = np.linspace(0, dataset.ends[-1] - 1, len(sample["target"])).astype(int)
    starts = set(dataset.starts.tolist())
    for number in range(0, len(rows), 7):
        row, side = rows[number], number % 2
        if row in starts:
            continue
        before = tips[row - 1, side, :, :2].astype(float)
        found = points_of_action(sample["target"][[number]], before[None], np.array([side]))
        np.testing.assert_allclose(found[0, 0], tips[row, side, :, :2], atol=1e-6)


def test_controls_are_those_of_the_data(dataset):
    sample = ControlsSamples.of(dataset).evenly(40)
    rows = np.linspace(0, dataset.ends[-1] - 1, 40).astype(int)
    for number, row in enumerate(rows):
        side = number % 2
        joints = dataset.columns["joints"][row][LAYOUT.among_hands(side)]
        found = controls_of_action(sample["target"][number], joints[None], np.array([side]))
        wanted = dataset.columns["action"][row][LAYOUT.actuators[side]]
        np.testing.assert_allclose(found[0], wanted, atol=1e-5)


def test_one_song_is_too_few(data, tmp_path, two_notes):
    alone = tmp_path / "alone.zarr"
    columns = {name: np.zeros((4, *column.shape), column.dtype) for name, column in COLUMNS.items()}
    write_trajectories(alone, iter([Episode("one", 1.0, "ik", columns, 1)]))
    with pytest.raises(InputError, match="two songs"):
        train_stage("fingering", SHORT, tmp_path, [alone])
