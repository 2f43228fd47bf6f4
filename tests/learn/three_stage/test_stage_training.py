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
from pianomime.plan.fingertip_plan import HOVER_HEIGHT
from pianomime.policies.features import rest_points
from pianomime.policies.three_stage.fingering import LOWEST
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


def chords() -> Dataset:
    """Two keys at a time, by fingers that change, with hovering fingertips."""
    goal = np.zeros((20, 88), bool)
    finger_key = np.full((20, 2, 5), -1, np.int8)
    for frame in range(20):
        low, high = 30 + frame // 4, 50 + frame // 5
        goal[frame, [low, high]] = True
        finger_key[frame, 0, frame // 4 % 5], finger_key[frame, 1, frame // 5 % 5] = low, high
    tips = np.random.default_rng(1).normal(size=(20, 2, 6, 3)).astype(np.float32)
    columns = {"goal": goal, "finger_key": finger_key, "fingertips": tips}
    return Dataset(columns, np.array([20]), np.array([0]), ["chords"])


def test_choices_are_those_of_the_data():
    clip = chords()
    samples = FingeringSamples.of(clip)
    pressed = clip.columns["finger_key"].reshape(20, 10)
    plain = 0
    for row, key, choice, below, used in zip(
        samples.row, samples.key, samples.choice, samples.below, samples.used, strict=True
    ):
        assert samples.goal[row, key]
        # The first clip is as it is; the second is its image in a mirror.
        if row > 20:
            continue
        plain += 1
        assert pressed[row - 1, choice] == key
        low = np.flatnonzero(samples.goal[row]).min()
        first = key == low
        assert below == (LOWEST if first else np.flatnonzero(pressed[row - 1] == low)[0])
        assert np.flatnonzero(used).tolist() == ([] if first else [below])
    assert plain >= 9


def test_after_the_end_of_a_clip_nothing_is_pressed(dataset):
    """As in play, where goals are silence then."""
    held = dataset.columns["finger_key"].copy()
    held[dataset.ends - 1, 0, 1] = 30
    changed = replace(dataset, columns={**dataset.columns, "finger_key": held})
    sample = ControlsSamples.of(changed).evenly(int(dataset.ends[-1]))["observation"]
    presses = slice(27 + 27 + 18 + 96, 27 + 27 + 18 + 96 + 40)
    last = sample[dataset.ends[1] - 1, presses].reshape(8, 5)
    assert not last[1:].any()


def test_a_silent_data_set_is_told(tmp_path):
    silent = tmp_path / "silent.zarr"
    columns = {name: np.zeros((4, *column.shape), column.dtype) for name, column in COLUMNS.items()}
    columns["finger_key"] -= 1
    episodes = (Episode(str(number), 1.0, "ik", columns, number) for number in range(2))
    write_trajectories(silent, episodes)
    with pytest.raises(InputError, match="no notes"):
        train_stage("fingering", SHORT, tmp_path, [silent])


def test_heights_tell_alone_which_fingers_press(tmp_path, dataset, two_notes):
    """The plans of planners also say how high fingers hover, which is not known in play."""
    assert len(np.unique(two_notes.plan.fingertips[..., 2])) > 2
    heights = dataset.columns["fingertips"][..., 1:, 2]
    np.testing.assert_allclose(heights[dataset.columns["finger_key"] >= 0], 0.0)
    np.testing.assert_allclose(heights[dataset.columns["finger_key"] < 0], HOVER_HEIGHT)


def test_without_noise_motion_is_that_of_the_data(dataset):
    sample = MotionSamples(dataset).evenly(2 * int(dataset.ends[0]))
    tips = dataset.columns["fingertips"]
    rows = np.linspace(0, dataset.ends[-1] - 1, len(sample["target"])).astype(int)
    starts = set(dataset.starts.tolist())
    for number in [0, *range(1, len(rows), 7)]:
        row, side = rows[number], number % 2
        first = row in starts
        before = (rest_points()[side] if first else tips[row - 1, side])[:, :2].astype(float)
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


def test_another_stage_is_refused_before_data_are_read(tmp_path):
    with pytest.raises(InputError, match="stage must be one of fingering, hand-motion"):
        train_stage("controls", StageConfig(), tmp_path, [tmp_path / "none"])
