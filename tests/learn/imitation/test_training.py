from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pianomime import cli, load_player
from pianomime.errors import InputError
from pianomime.learn.data.episode import COLUMNS, Episode
from pianomime.learn.data.trajectories import write_trajectories
from pianomime.learn.goal.config import GoalConfig
from pianomime.learn.goal.training import train_goal
from pianomime.learn.imitation.config import DiffusionConfig, policy_config
from pianomime.learn.imitation.training import train_policy
from pianomime.learn.runs.trainer_config import TrainerConfig
from pianomime.plan.demonstration import Demonstration
from pianomime.policies.methods import WEIGHTS
from pianomime.progress import no_progress

SHORT = TrainerConfig(steps=4, batch=8, warmup=1)
NO_SDF = policy_config("high-diff-no-sdf")
TINY = DiffusionConfig(channels=(8, 8, 16), condition_layers=(16,), step_embedding=8)


@pytest.fixture(scope="module")
def data(two_notes: Demonstration, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Demonstrations and episodes of fifteen songs, and a goal encoder of two."""
    folder = tmp_path_factory.mktemp("data")
    demos, songs = folder / "demos", folder / "songs"
    demos.mkdir()
    songs.mkdir()
    for number in range(15):
        replace(two_notes, song_id=number).save(demos / f"{number:02d}.npz")
    for number in range(2):
        moved = replace(two_notes.score, key=two_notes.score.key + number)
        moved.to_midi(songs / f"{number}.mid")
    draw = np.random.default_rng(0)
    frames = len(two_notes.plan)
    columns = {
        name: draw.normal(0, 0.1, (frames, *column.shape)).astype(column.dtype)
        for name, column in COLUMNS.items()
    }
    columns["goal"] = two_notes.score.roll()
    columns["fingertips"] = two_notes.plan.fingertips.astype(np.float32)
    columns["keys"] = columns["goal"].astype(np.float32)
    episodes = (Episode(str(number), 1.0, "ik", columns, number) for number in range(15))
    write_trajectories(folder / "experts.zarr", episodes)
    config = GoalConfig(trainer=replace(SHORT, bfloat16=False))
    train_goal([songs], folder / "goal", config)
    return folder


def train(name, data, out, **changes):
    config = replace(policy_config(name), diffusion=TINY, trainer=SHORT, **changes)
    demos, experts = (data / "demos", []) if "high" in name else (None, [data / "experts.zarr"])
    return train_policy(name, config, out, demos, experts, data / "goal")


@pytest.mark.parametrize("low", ["low-diff", "low-diff-res"])
def test_what_was_trained_plays(data, two_notes, tmp_path, monkeypatch, low):
    """With codes of goals: data, goal encoder, training, export, playing."""
    for policy in ("high-diff", low):
        assert train(policy, data, tmp_path) == tmp_path / f"{policy}.onnx"
    monkeypatch.setenv(WEIGHTS, str(tmp_path))
    player = load_player("two-stage-diff-res" if low.endswith("res") else "two-stage-diff", 0)
    first, again = (player.play(two_notes.score) for _ in range(2))
    assert np.isfinite(first.ctrl).all()
    np.testing.assert_array_equal(first.ctrl, again.ctrl)


def test_what_is_finished_is_taken_as_it_is(data, tmp_path):
    first = train("high-diff-no-sdf", data, tmp_path).read_bytes()
    weights = tmp_path / "high-diff-no-sdf" / "result.safetensors"
    written = weights.stat().st_mtime_ns
    assert train("high-diff-no-sdf", data, tmp_path).read_bytes() == first
    assert weights.stat().st_mtime_ns == written
    with pytest.raises(InputError, match="tip_noise"):
        train("high-diff-no-sdf", data, tmp_path, tip_noise=0.5)


@pytest.mark.parametrize("policy", ["high-diff-no-sdf", "low-diff"])
def test_a_training_that_was_stopped_comes_to_the_same(data, tmp_path, policy):
    config = replace(
        policy_config(policy), diffusion=TINY, trainer=replace(SHORT, checkpoint_seconds=0.0)
    )
    demos, experts = (data / "demos", []) if "high" in policy else (None, [data / "experts.zarr"])

    def stop(phase, done, total, remark=""):
        if done == 2:
            raise KeyboardInterrupt

    def run(folder, progress=no_progress):
        return train_policy(policy, config, folder, demos, experts, data / "goal", progress)

    whole = run(tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "parts", stop)
    assert run(tmp_path / "parts").read_bytes() == whole.read_bytes()


def test_what_another_goal_encoder_trained_is_not_gone_on_with(data, tmp_path):
    train("high-diff", data, tmp_path)
    config = GoalConfig(trainer=replace(SHORT, bfloat16=False, seed=1))
    train_goal([data / "songs"], tmp_path / "goal", config)
    config = replace(policy_config("high-diff"), diffusion=TINY, trainer=SHORT)
    with pytest.raises(InputError, match="goal_encoder"):
        train_policy("high-diff", config, tmp_path, data / "demos", [], tmp_path / "goal")


def test_a_folder_of_the_name_of_another_policy(data, tmp_path, capsys):
    """The defaults are those of the policy that is named, wherever it stands."""
    experts, out = str(data / "experts.zarr"), str(tmp_path / "low-mse")
    short = [
        "--trainer.steps",
        "2",
        "--trainer.batch",
        "4",
        "--trainer.warmup",
        "0",
        "--mlp.hidden",
        "8",
    ]
    cli.main(["train", "bc-mse", "--experts", experts, "-o", out, *short])
    assert "bc-mse.onnx" in capsys.readouterr().out
    cli.main(["train", "-o", out, "bc-mse", "--experts", experts, *short])
    with pytest.raises(SystemExit):
        cli.main(["train", "--diffusion.no-skip", "bc-mse", "--experts", experts])
    assert "name the policy first" in capsys.readouterr().err


def test_what_is_missing_is_named(data, tmp_path):
    config = replace(policy_config("high-diff"), trainer=SHORT)
    with pytest.raises(InputError, match="--experts"):
        train_policy("high-diff", config, tmp_path, None, [], None)
    with pytest.raises(InputError, match="--experts"):
        train_policy("low-diff", policy_config("low-diff"), tmp_path, None, [], None)
    for policy, experts, message in (
        ("low-diff", [], "low-diff learns controls"),
        ("high-diff", [data / "experts.zarr"], "one of the two"),
    ):
        with pytest.raises(InputError, match=message):
            train_policy(policy, policy_config(policy), tmp_path, data / "demos", experts, None)
    with pytest.raises(InputError, match="does not exist"):
        train_policy("high-diff", config, tmp_path, data / "demos", [], tmp_path / "none")
    (tmp_path / "alone").mkdir()
    (tmp_path / "alone" / "0.npz").write_bytes((data / "demos" / "00.npz").read_bytes())
    with pytest.raises(InputError, match="two songs"):
        train_policy("high-diff-no-sdf", NO_SDF, tmp_path, tmp_path / "alone", [], None)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no demonstrations in this folder"):
        train_policy("high-diff-no-sdf", NO_SDF, tmp_path, tmp_path / "empty", [], None)


def test_experts_with_another_base_controller_are_refused(data, tmp_path):
    columns = {name: np.zeros((4, *column.shape), column.dtype) for name, column in COLUMNS.items()}
    episodes = (Episode(f"{number}", 0.0, "dynamic", columns, number) for number in range(3))
    write_trajectories(tmp_path / "other.zarr", episodes)
    config = replace(policy_config("low-diff-res"), diffusion=TINY, trainer=SHORT)
    with pytest.raises(InputError, match="base controller dynamic"):
        train_policy(
            "low-diff-res", config, tmp_path, None, [tmp_path / "other.zarr"], data / "goal"
        )


@pytest.mark.parametrize(
    ("column", "value", "refused"),
    [
        ("joints", np.nan, "joints of episode 0"),
        ("finger_key", 99, "finger_key of odd must be -1 to 87, not 99"),
        ("finger_key", -2, "finger_key of odd must be -1 to 87, not -2"),
    ],
)
def test_values_that_cannot_be_are_refused(data, tmp_path, column, value, refused):
    columns = {name: np.zeros((4, *column.shape), column.dtype) for name, column in COLUMNS.items()}
    columns[column][2] = value
    write_trajectories(tmp_path / "odd.zarr", iter([Episode("odd", 0.0, "ik", columns)]))
    with pytest.raises(InputError, match=refused):
        train_policy(
            "bc-mse", policy_config("bc-mse"), tmp_path, None, [tmp_path / "odd.zarr"], None
        )
