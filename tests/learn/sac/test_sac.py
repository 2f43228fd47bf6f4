from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sb3_contrib import TQC
from stable_baselines3 import SAC

from pianomime import load_player
from pianomime.errors import InputError, TrainingDiverged
from pianomime.learn.envs.reward import REACH_BOUND, REACH_MARGIN, press_reward, reach_reward
from pianomime.learn.envs.sb3_multi_song import PlayedFrame
from pianomime.learn.runs.run import RunFolder
from pianomime.learn.sac import training
from pianomime.learn.sac.config import SacConfig
from pianomime.learn.sac.training import ACTION_SCALE, GoalSong, SacVecEnv, train_sac
from pianomime.policies.methods import WEIGHTS
from pianomime.policies.network_file import load_network
from pianomime.world.hand import hand_points
from pianomime.world.parameters import key_centres

SMALL = SacConfig(
    total_steps=200,
    num_envs=2,
    gradient_steps=1,
    batch_size=8,
    buffer_size=400,
    hidden=(16,),
    seconds=2.0,
)


def test_who_does_nothing_stays_where_it_is(two_notes):
    env = SacVecEnv([GoalSong.of(two_notes.score)], SMALL, 1)
    env.reset()
    for _ in range(5):
        env.step(np.zeros((2, 46), np.float32))
    # But for what hangs down and springs back.
    assert np.abs(env.worlds.qpos_hands).max() < 0.1


def test_an_action_moves_an_actuator_by_its_step(two_notes):
    env = SacVecEnv([GoalSong.of(two_notes.score)], SMALL, 1)
    env.reset()
    actions = np.zeros((2, 1, 46))
    held = env.controls(actions)
    actions[:, 0, 7] = 1.0
    moved = env.controls(actions) - held
    np.testing.assert_allclose(moved[:, 7], ACTION_SCALE[7])
    np.testing.assert_allclose(np.delete(moved, 7, axis=1), 0.0)


def test_a_finger_is_near_to_each_key_by_its_place_along_the_keyboard():
    goal, tips = np.zeros((3, 88), bool), np.zeros((3, 2, 5, 3))
    tips[..., 1] = key_centres()[40, 1]
    goal[0, 40] = goal[1, [40, 87]] = True
    one, half, silent = reach_reward(tips, goal)
    assert one == silent == 1.0
    assert half == pytest.approx(0.5, abs=1e-3)
    tips[..., 1] += REACH_BOUND + REACH_MARGIN
    assert reach_reward(tips, goal)[0] == pytest.approx(0.1)


@pytest.mark.parametrize("reach", [0.0, 2.0])
def test_the_reward_is_the_papers_and_a_term_for_fingers_that_are_near(two_notes, reach):
    config = replace(SMALL, hit=0.75, reach=reach)
    env = SacVecEnv([GoalSong.of(two_notes.score)], config, 1)
    env.reset()
    goal = np.zeros((2, 88), bool)
    tips = hand_points(env.worlds.qpos_hands)[:, :, 1:]
    under = int(np.abs(key_centres()[:, 1] - tips[0, 1, 2, 1]).argmin())
    goal[0, under] = goal[1, 87] = True
    silent = np.zeros((2, 88))
    played = PlayedFrame(env.rows, goal, silent > 0, silent)
    (near,), (far,) = env.rewards(played, np.zeros((2, 1, 46)))
    # No wrong key is a quarter; a key that stays up is next to nothing.
    pressed = 0.75 * press_reward(silent, silent > 0, goal, 1.0)
    assert near == pytest.approx(0.25 + pressed[0] + reach, abs=0.1 * reach + 1e-9)
    assert far - 0.25 - pressed[1] == pytest.approx(0.0, abs=0.5 * reach + 1e-9)
    assert (near > far) == (reach > 0)


def test_what_was_trained_plays(two_notes, tmp_path, monkeypatch):
    songs = tmp_path / "songs"
    songs.mkdir()
    two_notes.score.to_midi(songs / "one.mid")
    made = train_sac([songs], tmp_path / "out", SMALL, 1)
    monkeypatch.setenv(WEIGHTS, str(tmp_path / "out"))
    played = load_player("multi-task-sac", 0).play(two_notes.score)
    assert np.isfinite(played.ctrl).all()
    written = made.stat().st_mtime_ns
    train_sac([songs], tmp_path / "out", SMALL, 1)
    assert made.stat().st_mtime_ns == written


def test_a_file_of_another_training_is_not_taken_for_the_result(two_notes, tmp_path, monkeypatch):
    songs, out = tmp_path / "songs", tmp_path / "out"
    songs.mkdir()
    out.mkdir()
    two_notes.score.to_midi(songs / "one.mid")
    (out / "multi-task-sac.onnx").write_bytes(b"of another training")

    def full(*_):
        raise OSError("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(training, "export_network", full)
        with pytest.raises(OSError, match="full"):
            train_sac([songs], out, SMALL, 1)

    def learn(*_):
        raise AssertionError("it was trained already")

    monkeypatch.setattr(training._Callback, "learn", learn)
    load_network(train_sac([songs], out, SMALL, 1))


def test_weights_that_diverge_in_the_last_update_are_no_result(two_notes, tmp_path, monkeypatch):
    songs, out = tmp_path / "songs", tmp_path / "out"
    songs.mkdir()
    two_notes.score.to_midi(songs / "one.mid")
    learn = SAC.learn

    def diverge(model, *given, **named):
        learn(model, *given, **named)
        next(model.policy.parameters()).data.fill_(float("nan"))

    monkeypatch.setattr(SAC, "learn", diverge)
    with pytest.raises(TrainingDiverged, match="no finite numbers at step 200"):
        train_sac([songs], out, SMALL, 1)
    assert not list(out.rglob("*.onnx"))


@pytest.mark.parametrize("changes", [{}, {"buffer_size": 60}, {"algorithm": "tqc", "reach": 0.5}])
def test_a_training_that_was_stopped_comes_to_the_same(two_notes, tmp_path, monkeypatch, changes):
    """Also when frames that were played first are forgotten again."""
    songs, config = tmp_path / "songs", replace(SMALL, **changes)
    songs.mkdir()
    two_notes.score.to_midi(songs / "one.mid")
    monkeypatch.setattr(training, "_CHECKPOINT_STEPS", 50)
    train_sac([songs], tmp_path / "whole", config, 1)
    kept = RunFolder.checkpoint

    def stop(self, arrays, steps):
        kept(self, arrays, steps)
        if steps == 150:
            raise KeyboardInterrupt

    monkeypatch.setattr(RunFolder, "checkpoint", stop)
    with pytest.raises(KeyboardInterrupt):
        train_sac([songs], tmp_path / "parts", config, 1)
    monkeypatch.setattr(RunFolder, "checkpoint", kept)
    train_sac([songs], tmp_path / "parts", config, 1)
    one, other = (
        RunFolder.load(tmp_path / name / "multi-task-sac").result()[0]
        for name in ("whole", "parts")
    )
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name])


@pytest.mark.parametrize("algorithm", [SAC, TQC])
def test_the_file_does_what_the_actor_does(two_notes, tmp_path, monkeypatch, algorithm):
    """Of what the environment shows, the mean of its actions, in steps of the actuators."""
    songs, kept = tmp_path / "songs", []
    songs.mkdir()
    two_notes.score.to_midi(songs / "one.mid")

    name = algorithm.__name__.lower()

    class Kept(algorithm):
        def __init__(self, policy, env, **settings):
            super().__init__(policy, env, **settings)
            kept.append((self, env))

    monkeypatch.setitem(training._ALGORITHMS, name, Kept)
    made = train_sac([songs], tmp_path / "out", replace(SMALL, algorithm=name), 1)
    (model, env), (run, _) = kept[0], load_network(made)
    scaled = env.agent_observations()[:, 0]
    env.normalizer = None
    plain = env.agent_observations()[:, 0]
    wanted = ACTION_SCALE * model.predict(scaled, deterministic=True)[0]
    given = {"goal": plain[:, : 4 * 88].reshape(-1, 4, 88), "vector": plain[:, 4 * 88 :]}
    np.testing.assert_allclose(run(given)[0][:, 0], wanted, atol=1e-3)


@pytest.mark.parametrize(
    "change",
    [
        {"total_steps": 80},
        {"buffer_size": 4},
        {"gamma": -0.1},
        {"hit": 1.5},
        {"reach": -1.0},
        {"algorithm": "ppo"},
        {"hidden": (16, 0)},
    ],
)
def test_settings_out_of_range_are_refused(change):
    with pytest.raises(InputError):
        replace(SMALL, **change)
