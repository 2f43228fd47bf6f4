from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import VecCheckNan
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from pianomime import load_player
from pianomime.errors import InputError
from pianomime.learn.fingers.config import FingersConfig
from pianomime.learn.fingers.env import FingersVecEnv, PlannedSong, finger_rewards
from pianomime.learn.fingers.training import train_fingers
from pianomime.learn.runs.run import RunFolder
from pianomime.plan import FingertipPlan
from pianomime.policies.finger_residual import (
    AMPLITUDE,
    SIZE,
    FingerObservation,
    FingerResidualTracker,
    controls,
)
from pianomime.policies.methods import WEIGHTS
from pianomime.track import DynamicTracker
from pianomime.world import World
from pianomime.world.parameters import key_centres

SMALL = FingersConfig(
    total_steps=400,
    num_envs=2,
    steps_per_update=80,
    batch_size=100,
    n_epochs=1,
    hidden=(8,),
    seconds=2.0,
)


def silent(given):
    return [np.zeros((10, 5), np.float32)]


def curve(folder):
    """What TensorBoard shows of a training."""
    shown = EventAccumulator(str(RunFolder.load(folder).tensorboard))
    shown.Reload()
    return shown.Scalars("rollout/reward")


def moved(score, keys):
    return replace(score, key=score.key + keys)


def test_who_adds_nothing_plays_as_the_dynamic_tracker_does(two_notes):
    trackers = DynamicTracker(), FingerResidualTracker(silent)
    plain, added = (tracker.start(two_notes.plan) for tracker in trackers)
    world = World()
    for frame in range(12):
        ctrl = plain.control(frame, world)
        np.testing.assert_array_equal(added.control(frame, world), ctrl)
        world.step(ctrl)


class _Aiming:
    """A controller of a plan that aims at these points, along these joints."""

    def __init__(self, plan, aim, path):
        self.plan, self._aim, self._path = plan, aim, path

    def aim(self, frame):
        return self._aim, self._path


def test_left_fingers_are_told_what_right_ones_are_in_a_mirror(two_notes):
    """Of a plan and a world that are their own mirror images: about a D, also keys are."""
    plan = PlannedSong.of(two_notes.score).demonstration.plan
    low, high, centre = 31, 51, key_centres()[41, 1]
    keys = np.full_like(plan.finger_key, -1)
    keys[6:16, 0, 1], keys[6:16, 1, 1] = low, high
    keys[9:16, 0, 3], keys[9:16, 1, 3] = low - 5, high + 5

    def both(right):
        """Points (..., 3) of the left hand and of the right."""
        return np.array([right * [1, -1, 1] + [0, 2 * centre, 0], right])

    draw = np.random.default_rng(0)
    beside = key_centres()[high] - [0.0, 0.03, 0.0]
    points = beside + [0, 0.014, 0] * np.arange(6)[:, None] + draw.normal(0, 0.003, (6, 3))
    aim = points[1:] + draw.normal(0, 0.01, (5, 3))
    mirror = np.r_[-1.0, np.ones(26)]
    pose, path, velocity = draw.normal(0, 0.05, (3, 27))
    state = np.zeros(88)
    state[: 2 * 41 + 1] = draw.random(2 * 41 + 1)
    state[: 2 * 41 + 1] = np.maximum(state[: 2 * 41 + 1], state[2 * 41 :: -1])
    around = FingerObservation(
        _Aiming(
            FingertipPlan(plan.fingertips, keys, plan.note_hand, plan.note_finger),
            both(aim),
            np.array([path * mirror, path]),
        )
    )
    qpos, qvel = (np.r_[right, right * mirror] for right in (pose, velocity))
    told = around.encode(8, np.r_[np.zeros(88), qpos], qvel, state, both(points))
    left, right = told.reshape(2, 5, SIZE)
    np.testing.assert_allclose(left, right, atol=1e-4)
    assert (np.ptp(right, axis=0) > 0).sum() > 30


def test_each_finger_moves_its_own_actuators_and_no_further_than_it_may():
    said = np.zeros((10, 5))
    seen = np.zeros(46, bool)
    for row in range(10):
        said[:] = 0.0
        said[row] = 7.0
        added = controls(said)
        assert set(np.unique(added)) == {0.0, AMPLITUDE}
        assert not (seen & (added != 0)).any()
        seen |= added != 0
    # Wrists and forearms are nobody's.
    assert np.flatnonzero(~seen).tolist() == [0, 1, 20, 21, 22, 23, 24, 43, 44, 45]


def test_a_finger_answers_for_its_own_key_and_for_wrong_ones_beside_it():
    pressed = np.zeros((1, 88), bool)
    wanted = np.zeros((1, 88), bool)
    pressed[0, [40, 42]], wanted[0, [40, 50]] = True, True
    keys = np.full((1, 2, 5), -1, np.int8)
    keys[0, 0, 1], keys[0, 1, 2] = 40, 50
    tips = np.zeros((1, 10, 3))
    tips[..., 1] = 1.0
    tips[0, 1] = key_centres()[40]
    tips[0, 2] = key_centres()[42]
    tips[0, 7] = key_centres()[50]
    reward = finger_rewards(pressed, pressed.astype(float), wanted, keys, tips, 2.0)[0]
    assert reward[1] == pytest.approx(1.0)
    assert reward[2] == -2.0
    assert reward[7] == 0.0
    assert not np.delete(reward, [1, 2]).any()


def test_songs_follow_one_another_in_every_world(two_notes):
    songs = [PlannedSong.of(two_notes.score), PlannedSong.of(moved(two_notes.score, 3))]
    env = FingersVecEnv(songs, SMALL, 1)
    checked = VecCheckNan(env)
    env.seed(3)
    told = checked.reset()
    assert told.shape == (20, SIZE)
    frames = len(songs[0].goal)
    first = env.rows[:, 0].tolist()
    for _ in range(frames):
        told, reward, done, infos = checked.step(np.zeros((20, 5), np.float32))
    assert done.all()
    assert not reward.any()
    assert "terminal_observation" in infos[0]
    assert not env.rows[:, 1].any()
    assert {*first, *env.rows[:, 0].tolist()} == {0, 1}


def test_worlds_go_on_from_their_state_bit_for_bit(two_notes):
    env = FingersVecEnv([PlannedSong.of(two_notes.score)], SMALL, 1)
    env.reset()
    action = np.random.default_rng(0).uniform(-1, 1, (20, 5)).astype(np.float32)
    for _ in range(9):
        env.step(action)
    state = env.state()
    env.set_state(state)
    told = env.step(action)[0]
    env.step(action)
    env.set_state(state)
    np.testing.assert_array_equal(env.step(action)[0], told)


@pytest.fixture
def songs(two_notes, tmp_path: Path) -> Path:
    folder = tmp_path / "songs"
    folder.mkdir()
    for number in range(9):
        moved(two_notes.score, number).to_midi(folder / f"{number}.mid")
    return folder


def test_what_was_trained_plays_and_is_taken_as_it_is(songs, two_notes, tmp_path, monkeypatch):
    made, measured = train_fingers([songs], tmp_path / "out", SMALL, 1)
    assert 0.0 < measured["validation/f1_base"] <= 1.0
    monkeypatch.setenv(WEIGHTS, str(tmp_path / "out"))
    player = load_player("fingers", 0)
    first, again = (player.play(two_notes.score) for _ in range(2))
    np.testing.assert_array_equal(first.ctrl, again.ctrl)
    zero_shot = load_player("zero-shot-20hz", 0).play(two_notes.score)
    assert not np.array_equal(first.ctrl, zero_shot.ctrl)
    written = made.stat().st_mtime_ns
    train_fingers([songs], tmp_path / "out", SMALL, 1)
    assert made.stat().st_mtime_ns == written
    with pytest.raises(InputError, match="total_steps"):
        train_fingers([songs], tmp_path / "out", replace(SMALL, total_steps=800), 1)


def test_a_training_that_was_stopped_comes_to_the_same(songs, tmp_path, monkeypatch):
    from pianomime.learn.fingers import training

    # Other tests in this process, such as those of Ray, may have left threads behind.
    before = threading.active_count()
    monkeypatch.setattr(training, "_CHECKPOINT_UPDATES", 1)
    whole, _ = train_fingers([songs], tmp_path / "whole", SMALL, 1)

    def stop(phase: str, done: int, total: int, remark: str = "") -> None:
        if phase == "training" and done >= 240:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_fingers([songs], tmp_path / "parts", SMALL, 1, progress=stop)
    train_fingers([songs], tmp_path / "parts", SMALL, 1)
    # The curve goes on where it was, and what came before is still shown.
    one, other = (
        [event.step for event in curve(tmp_path / name / "fingers")] for name in ("whole", "parts")
    )
    assert one == other
    one, other = (
        RunFolder.load(tmp_path / name / "fingers").result()[0] for name in ("whole", "parts")
    )
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name])
    assert whole.exists()
    assert threading.active_count() <= before + 2


def test_the_file_acts_as_the_network_does(songs, tmp_path):
    from pianomime.learn.runs.safetensors_file import read_tensors
    from pianomime.policies.network_file import load_network

    made, _ = train_fingers([songs], tmp_path / "out", SMALL, 1)
    run, info = load_network(made)
    assert (info.name, info.level, info.residual) == ("fingers", "finger", True)
    told = np.random.default_rng(0).normal(size=(10, SIZE)).astype(np.float32)
    arrays, _ = read_tensors(tmp_path / "out" / "fingers" / "result.safetensors")
    hidden = torch.nn.Sequential(torch.nn.Linear(SIZE, 8), torch.nn.Tanh(), torch.nn.Linear(8, 5))
    hidden.load_state_dict({name: torch.from_numpy(array.copy()) for name, array in arrays.items()})
    with torch.inference_mode():
        wanted = hidden(torch.from_numpy(told)).numpy()
    np.testing.assert_allclose(run({"observation": told})[0], wanted, atol=1e-5)


@pytest.mark.parametrize(
    "change",
    [
        {"total_steps": 0},
        {"batch_size": 1},
        {"learning_rate": 0.0},
        {"gamma": 1.5},
        {"num_envs": 200},
        {"num_envs": 3},
        {"hidden": (0,)},
    ],
)
def test_settings_with_which_nothing_can_be_learned_are_refused(change):
    with pytest.raises(InputError):
        replace(SMALL, **change)


def test_too_few_songs_are_refused(two_notes, tmp_path):
    two_notes.score.to_midi(tmp_path / "one.mid")
    with pytest.raises(InputError, match="songs"):
        train_fingers([tmp_path], tmp_path / "out", SMALL, 1)
