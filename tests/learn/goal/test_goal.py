from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from pianomime.errors import InputError
from pianomime.learn.goal.autoencoder import GoalAutoencoder, GoalEncoder
from pianomime.learn.goal.config import GoalConfig
from pianomime.learn.goal.goals import Goals, read_goals, transpose
from pianomime.learn.goal.sdf import KEYBOARD_LENGTH, distance
from pianomime.learn.goal.training import evaluate_autoencoder, load_encoder, train_goal
from pianomime.learn.runs.trainer_config import TrainerConfig
from pianomime.music import Score
from pianomime.progress import no_progress
from pianomime.world.parameters import key_centres

KEY_SETS = st.sets(st.integers(0, 87), max_size=8)
PLACES = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.6, 0.6), st.floats(0, 0.1))


def goal_of(keys):
    goal = torch.zeros(88, dtype=torch.float64)
    goal[sorted(keys)] = 1.0
    return goal


@settings(deadline=None, max_examples=40)
@given(keys=KEY_SETS, place=PLACES)
def test_distance_is_that_to_the_nearest_key(keys, place):
    far = [np.linalg.norm(key_centres()[key] - place) for key in keys]
    found = float(distance(goal_of(keys), torch.tensor(place, dtype=torch.float64)))
    assert found == pytest.approx(min([*far, KEYBOARD_LENGTH]))


@settings(deadline=None, max_examples=40)
@given(keys=KEY_SETS, more=KEY_SETS, place=PLACES, other=PLACES)
def test_laws_of_distance(keys, more, place, other):
    here, there = (torch.tensor(one, dtype=torch.float64) for one in (place, other))
    near = float(distance(goal_of(keys), here))
    # It changes no faster than the place, and more keys can only be nearer.
    assert abs(near - float(distance(goal_of(keys), there))) <= float((here - there).norm()) + 1e-9
    assert float(distance(goal_of(keys | more), here)) <= near + 1e-9


def test_silence_is_far_from_everywhere_and_no_key():
    for key in (0, 40, 87):
        assert float(distance(goal_of([]), torch.tensor(key_centres()[key]))) == KEYBOARD_LENGTH
    assert float(distance(goal_of([0]), torch.tensor(key_centres()[0]))) == 0.0


@settings(deadline=None, max_examples=40)
@given(keys=KEY_SETS, semitones=st.integers(-90, 90))
def test_transposing_keeps_the_shape_and_loses_no_key(keys, semitones):
    goal = goal_of(keys).numpy()[None] > 0.5
    moved = transpose(goal, np.array([semitones]))
    before, after = (np.flatnonzero(one[0]) for one in (goal, moved))
    assert len(before) == len(after)
    if len(before):
        assert len(set((after - before).tolist())) == 1
        assert abs(after[0] - before[0]) <= abs(semitones)


def test_a_code_does_not_depend_on_what_else_is_coded():
    torch.manual_seed(0)
    goals = (torch.rand(20, 88) < 0.05).float()
    encoder = GoalEncoder()
    encoder.standardize(goals)
    for mode in (True, False):
        encoder.train(mode)
        torch.testing.assert_close(encoder(goals)[3], encoder(goals[3]))
    codes = encoder(goals)
    torch.testing.assert_close(codes.mean(dim=0), torch.zeros(16), atol=1e-4, rtol=0)
    torch.testing.assert_close(codes.std(dim=0, correction=0), torch.ones(16), atol=1e-3, rtol=0)
    assert sum(weight.numel() for weight in encoder.parameters()) == 2152


@pytest.fixture
def folder(tmp_path):
    songs = tmp_path / "songs"
    songs.mkdir()
    for number in range(6):
        key = np.arange(8) + 30 + 2 * number
        onset = np.arange(8) * 0.2
        Score(key, onset, onset + 0.3, np.full(8, 80)).to_midi(songs / f"{number}.mid")
    (songs / "broken.mid").write_bytes(b"no music")
    return songs


def test_training_measures_on_other_files_and_can_be_read(folder, tmp_path):
    config = GoalConfig(trainer=TrainerConfig(steps=30, batch=16, warmup=2, bfloat16=False))
    metrics, goals = train_goal([folder], tmp_path / "goal", config)
    assert (goals.files, goals.validation_files, goals.skipped) == (5, 1, 1)
    assert 0 < metrics.error_mm < 1e3 * KEYBOARD_LENGTH
    keys = torch.from_numpy(goals.train.keys().astype(np.float32))
    codes = load_encoder(tmp_path / "goal")(keys)
    assert not codes.requires_grad
    assert (tmp_path / "goal" / "codes.png").stat().st_size > 1000
    # What is finished is taken as it is.
    again, _ = train_goal([folder], tmp_path / "goal", config)
    assert again == metrics
    torch.testing.assert_close(load_encoder(tmp_path / "goal")(keys), codes)


def test_it_learns_where_keys_are(folder, tmp_path):
    short = GoalConfig(
        transpose=0, trainer=TrainerConfig(steps=5, batch=32, warmup=1, bfloat16=False)
    )
    config = GoalConfig(
        transpose=0,
        trainer=TrainerConfig(steps=400, batch=32, learning_rate=3e-3, warmup=20, bfloat16=False),
    )
    before, _ = train_goal([folder], tmp_path / "short", short)
    after, _ = train_goal([folder], tmp_path / "long", config)
    assert after.error_mm < 0.5 * before.error_mm


def test_too_few_goals_to_measure_on_are_told_at_once(tmp_path):
    for key in range(3):
        Score([40 + key], [0.0], [0.5], [80]).to_midi(tmp_path / f"{key}.mid")
    with pytest.raises(InputError, match="too few"):
        train_goal([tmp_path], tmp_path / "goal", GoalConfig())
    assert not (tmp_path / "goal").exists()


def test_the_same_seed_learns_the_same(folder, tmp_path):
    def codes(name, seed):
        trainer = TrainerConfig(steps=5, batch=16, warmup=1, seed=seed, bfloat16=False)
        train_goal([folder], tmp_path / name, GoalConfig(trainer=trainer))
        return load_encoder(tmp_path / name)(torch.eye(88))

    one = codes("one", 0)
    torch.testing.assert_close(one, codes("again", 0), rtol=0, atol=0)
    assert not torch.equal(one, codes("other", 1))


def test_files_are_on_one_side_only(folder):
    first, again = (read_goals([folder], 0.3, no_progress) for _ in range(2))
    assert first.train.digest == again.train.digest
    assert (first.files, first.validation_files) == (4, 2)


@pytest.mark.parametrize("content", [None, b"", b"no weights"])
def test_an_encoder_that_is_not_there_or_damaged(tmp_path, content):
    if content is not None:
        (tmp_path / "goal.safetensors").write_bytes(content)
    with pytest.raises(InputError):
        load_encoder(tmp_path)


def test_goals_are_counted_once():
    roll = np.zeros((6, 88), bool)
    roll[1:3, 4] = roll[4:, 4] = True
    goals = Goals.from_roll(roll)
    assert sorted(goals.frames.tolist()) == [2, 4]


@pytest.mark.parametrize(
    "settings", [{"queries": 0}, {"octaves": 13}, {"transpose": 88}, {"validation_share": 0.95}]
)
def test_settings_out_of_range_are_refused(settings):
    with pytest.raises(InputError, match="must be"):
        GoalConfig(**settings)


def test_distances_that_are_all_alike_have_no_rank_correlation():
    """As those between goals of two single notes, of which there is one."""
    module, goal = GoalAutoencoder(4).eval(), torch.zeros(2, 88)
    goal[0, 40] = goal[1, 50] = 1.0
    metrics = evaluate_autoencoder(module, goal)
    assert np.isnan([metrics.code_correlation, metrics.key_correlation]).all()
    assert np.isfinite(metrics.error_mm)
