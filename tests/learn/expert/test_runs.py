"""Runs: determinism, checkpoints, resuming after a kill, and what is refused."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from pianomime.errors import InputError, TrainingDiverged
from pianomime.learn.envs.batch import SongBatch
from pianomime.learn.envs.config import ActionConfig, EnvConfig, RewardConfig
from pianomime.learn.envs.sb3_env import Sb3Env
from pianomime.learn.expert.config import ExpertConfig, PpoConfig
from pianomime.learn.expert.expert import load_expert, train_expert
from pianomime.learn.expert.expert_run import ExpertRun
from pianomime.learn.expert.expert_worker import expert_request
from pianomime.learn.expert.ppo import make_model
from pianomime.learn.runs import safetensors_file
from pianomime.learn.runs.config_json import from_json, to_json
from pianomime.plan import FingertipPlan
from pianomime.plan.demonstration import Demonstration
from pianomime.world import WorldBatch

METHODS = ("ppo", "search")


@pytest.fixture
def demo(shallow: Demonstration, tmp_path: Path) -> Path:
    path = tmp_path / "demo.npz"
    shallow.save(path)
    return path


@pytest.fixture
def config(
    request: pytest.FixtureRequest, small_ppo: ExpertConfig, small_search: ExpertConfig
) -> ExpertConfig:
    made: ExpertConfig = {"ppo": small_ppo, "search": small_search}[request.param]
    return made


def tensors_of(run: ExpertRun) -> dict[str, bytes]:
    state = run.state()
    assert state is not None
    return {name: array.tobytes() for name, array in {**state.arrays, **run.best()[0]}.items()}


@pytest.mark.parametrize("config", METHODS, indirect=True)
def test_same_seed_same_expert_which_plays_what_was_measured(
    demo: Path, tmp_path: Path, config: ExpertConfig
) -> None:
    one, same = (train_expert(demo, tmp_path / name, config, threads=1) for name in "ab")
    other = train_expert(demo, tmp_path / "c", dataclasses.replace(config, seed=1), threads=1)
    assert one.curve() == same.curve()
    assert tensors_of(one) == tensors_of(same)
    assert tensors_of(one) != tensors_of(other)
    player, run = load_expert(tmp_path / "a")
    metrics = player.play(run.demonstration.score).metrics()
    best = run.best()[1]
    assert {name: best[name] for name in ("precision", "recall", "f1")} == {
        name: metrics[name] for name in ("precision", "recall", "f1")
    }
    assert best["f1"] == max(one.f1 for one in run.curve())


def kill_after_a_checkpoint(request: dict[str, Any]) -> None:
    """Start the training in a process, and kill it in the middle."""
    script = (
        "import json, sys\n"
        "from pianomime.learn.expert.expert_worker import train_one\n"
        "train_one(json.loads(sys.argv[1]))\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script, json.dumps(request)])
    curve = Path(request["out"], "curve.json")
    while process.poll() is None and (not curve.exists() or len(json.loads(curve.read_text())) < 2):
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()


@pytest.mark.parametrize("config", METHODS, indirect=True)
def test_a_killed_run_goes_on_to_the_same_curve(
    demo: Path, tmp_path: Path, config: ExpertConfig
) -> None:
    config = dataclasses.replace(config, total_steps=3 * config.total_steps)
    whole = train_expert(demo, tmp_path / "whole", config, threads=1)
    request = expert_request(demo, tmp_path / "killed", config, 0.0, 30.0)
    kill_after_a_checkpoint(request)
    before = ExpertRun.load(tmp_path / "killed").steps_done
    assert 0 < before < config.total_steps
    resumed = train_expert(demo, tmp_path / "killed", config, threads=1)
    assert resumed.curve() == whole.curve()
    assert tensors_of(resumed) == tensors_of(whole)


def test_more_steps_prolong_a_run(demo: Path, tmp_path: Path, small_ppo: ExpertConfig) -> None:
    longer = dataclasses.replace(small_ppo, total_steps=2 * small_ppo.total_steps)
    whole = train_expert(demo, tmp_path / "whole", longer, threads=1)
    train_expert(demo, tmp_path / "parts", small_ppo, threads=1)
    # All steps are spent: there is nothing to do.
    assert train_expert(demo, tmp_path / "parts", small_ppo).steps_done == small_ppo.total_steps
    longest = train_expert(demo, tmp_path / "parts", longer, threads=1)
    assert longest.curve() == whole.curve()


def test_less_steps_than_were_done_are_evaluated(
    demo: Path, tmp_path: Path, small_ppo: ExpertConfig
) -> None:
    """Where a run was stopped between two evaluations, what it has learned is not lost."""
    rare = dataclasses.replace(small_ppo.ppo, evaluate_every=1000)
    steps = small_ppo.ppo.steps_per_update
    config = dataclasses.replace(small_ppo, total_steps=1000 * steps, ppo=rare)

    def stop(phase: str, done: int, total: int, remark: str = "") -> None:
        if done > 2 * steps:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_expert(demo, tmp_path / "run", config, threads=1, progress=stop)
    state = ExpertRun.load(tmp_path / "run").state()
    assert state is not None
    assert state.steps == 2 * steps
    run = train_expert(
        demo, tmp_path / "run", dataclasses.replace(config, total_steps=steps), threads=1
    )
    assert run.steps_done == 2 * steps
    assert run.finished


def test_a_policy_that_diverges_is_one_line_and_the_checkpoint_stays(
    demo: Path, tmp_path: Path, small_ppo: ExpertConfig
) -> None:
    wild = dataclasses.replace(small_ppo.ppo, learning_rate=1e30, n_epochs=10)
    with pytest.raises(TrainingDiverged, match="try a lower learning rate"):
        train_expert(demo, tmp_path / "run", dataclasses.replace(small_ppo, ppo=wild), threads=1)
    state = ExpertRun.load(tmp_path / "run").state()
    assert state is not None
    assert all(np.isfinite(array).all() for array in state.arrays.values())


def test_a_folder_in_which_nothing_was_trained_takes_another_song(
    demo: Path,
    two_notes: Demonstration,
    tmp_path: Path,
    small_ppo: ExpertConfig,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out, other = tmp_path / "run", tmp_path / "other.npz"
    two_notes.save(other)

    with ExpertRun.open(out, Demonstration.load(demo), small_ppo, 0.0, 30.0):
        pass

    def killed(*_: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Demonstration, "save", killed)
        with pytest.raises(KeyboardInterrupt):
            train_expert(other, out, small_ppo, threads=1)
    config = dataclasses.replace(small_ppo, seed=1)
    run = train_expert(other, out, config, threads=1)
    assert load_expert(out)[1].config == config
    with pytest.raises(InputError, match="holds a run on another song"):
        train_expert(demo, out, config)
    assert run.finished


def test_a_full_disk_leaves_the_last_good_checkpoint(
    demo: Path, tmp_path: Path, small_ppo: ExpertConfig, full_disk: Any
) -> None:
    out = tmp_path / "run"
    train_expert(demo, out, small_ppo, threads=1)
    before = tensors_of(ExpertRun.load(out))
    longer = dataclasses.replace(small_ppo, total_steps=2 * small_ppo.total_steps)

    with full_disk():
        train_expert(demo, out, longer, threads=1)
    assert tensors_of(ExpertRun.load(out)) == before
    assert not [name for name in os.listdir(out) if name.startswith(".")]
    assert train_expert(demo, out, longer, threads=1).steps_done == longer.total_steps


@pytest.mark.parametrize("left", [(), ("run.json",), ("run.json", "demonstration.npz")])
def test_a_run_that_was_killed_at_its_beginning_begins_anew(
    demo: Path,
    two_notes: Demonstration,
    tmp_path: Path,
    small_search: ExpertConfig,
    left: tuple[str, ...],
) -> None:
    whole, out = tmp_path / "whole", tmp_path / "run"
    train_expert(demo, whole, small_search)
    out.mkdir()
    for name in left:
        (out / name).write_bytes((whole / name).read_bytes())
    # What a kill in the middle of writing a file leaves of it.
    half = out / ".pianomime-0123456789abcdef" / "out"
    half.mkdir(parents=True)
    (half / "run.json").write_bytes(b"cut")
    again = train_expert(demo, out, small_search)
    assert again.curve() == ExpertRun.load(whole).curve()
    assert not [name for name in os.listdir(out) if name.startswith(".")]
    # A song of somebody else is no beginning.
    (tmp_path / "theirs").mkdir()
    two_notes.save(tmp_path / "theirs" / "demonstration.npz")
    before = (tmp_path / "theirs" / "demonstration.npz").read_bytes()
    with pytest.raises(InputError, match="something else"):
        train_expert(demo, tmp_path / "theirs", small_search)
    assert (tmp_path / "theirs" / "demonstration.npz").read_bytes() == before
    # Also when it goes on; what is not ours stays.
    for name in (".pianomime-0123456789abcdef", ".mine"):
        (out / name).mkdir()
    train_expert(demo, out, small_search)
    assert [name for name in os.listdir(out) if name.startswith(".")] == [".mine"]


def test_a_search_has_the_threads_that_it_is_given(
    demo: Path, tmp_path: Path, small_search: ExpertConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: set[int] = set()

    def recorded(worlds: int, threads: int, **others: Any) -> WorldBatch:
        asked.add(threads)
        return WorldBatch(worlds, threads, **others)

    monkeypatch.setattr("pianomime.track.sampling.rollouts.WorldBatch", recorded)
    one = train_expert(demo, tmp_path / "one", small_search, threads=1)
    assert asked == {1}
    two = train_expert(demo, tmp_path / "two", small_search, threads=2)
    assert asked == {1, 2}
    assert one.curve() == two.curve()


@pytest.mark.parametrize("config", METHODS, indirect=True)
def test_the_curve_is_in_tensorboard(demo: Path, tmp_path: Path, config: ExpertConfig) -> None:
    run = train_expert(demo, tmp_path / "run", config, threads=1)
    log = EventAccumulator(str(run.tensorboard))
    log.Reload()
    for name in ("precision", "recall", "f1"):
        logged = [(event.step, event.value) for event in log.Scalars(f"eval/{name}")]
        assert logged == [
            (one.steps, pytest.approx(getattr(one, name), abs=1e-6)) for one in run.curve()
        ]


def test_reward_terms_are_in_tensorboard(
    demo: Path, tmp_path: Path, small_ppo: ExpertConfig
) -> None:
    """The mean of each term over the steps of an update; they add up to that of the reward."""
    run = train_expert(demo, tmp_path / "run", small_ppo, threads=1)
    log = EventAccumulator(str(run.tensorboard))
    log.Reload()
    tags = ("reward/press", "reward/mimic", "rollout/step_reward_mean")
    press, mimic, total = ([event.value for event in log.Scalars(tag)] for tag in tags)
    steps = [event.step for event in log.Scalars("reward/press")]
    assert steps == [128, 256, 384]
    np.testing.assert_allclose(np.add(press, mimic), total, rtol=1e-5)
    assert "reward/pedal" not in log.Tags()["scalars"]


def test_the_policy_works_the_pedal_when_it_plays(
    demo: Path, tmp_path: Path, small_ppo: ExpertConfig
) -> None:
    env = EnvConfig(action=ActionConfig(pedal=True), reward=RewardConfig(pedal=1.0))
    run = train_expert(demo, tmp_path / "run", dataclasses.replace(small_ppo, env=env), threads=1)
    best, about = run.best()
    arrays = {name: array.copy() for name, array in best.items()}
    assert arrays["4.bias"].shape == (47,)
    score = run.demonstration.score
    for sign in (1.0, -1.0):
        # The last layer alone says where the pedal is.
        arrays["4.weight"][46], arrays["4.bias"][46] = 0.0, sign
        safetensors_file.write_tensors(run.path / "result.safetensors", arrays, about)
        assert (load_expert(run.path)[0].play(score).pedal == (sign > 0)).all()
    plain = train_expert(demo, tmp_path / "plain", small_ppo, threads=1)
    played = load_expert(plain.path)[0].play(score)
    np.testing.assert_array_equal(played.pedal, score.pedal_roll())


@pytest.mark.parametrize(
    ("activation", "layer"), [("gelu", torch.nn.GELU), ("tanh", torch.nn.Tanh)]
)
def test_the_networks_are_as_the_settings_say(
    two_notes: Demonstration, activation: str, layer: type[torch.nn.Module]
) -> None:
    settings = PpoConfig(
        num_envs=2,
        steps_per_update=32,
        batch_size=32,
        n_epochs=1,
        hidden=(24, 12, 6),
        activation=activation,  # type: ignore[arg-type]
        learning_rate=1e-3,
        learning_rate_decay=0.5,
    )
    model = make_model(Sb3Env(SongBatch(two_notes, EnvConfig(), 2, 1)), settings, 0)
    for network in (model.policy.mlp_extractor.policy_net, model.policy.mlp_extractor.value_net):
        assert [part.out_features for part in network[::2]] == [24, 12, 6]
        assert all(isinstance(part, layer) for part in network[1::2])
    rates = []
    for _ in range(3):
        model.learn(32, reset_num_timesteps=False)
        rates.append(model.policy.optimizer.param_groups[0]["lr"])
    np.testing.assert_allclose(rates, [1e-3, 5e-4, 2.5e-4])


@pytest.mark.parametrize("method", METHODS)
def test_learning_works(demo: Path, tmp_path: Path, method: str) -> None:
    """Two notes that the base controller does not press; residuals do."""
    ppo = PpoConfig(
        num_envs=8,
        steps_per_update=464,
        batch_size=116,
        n_epochs=8,
        hidden=(64, 32),
        learning_rate=3e-3,
        initial_std=0.8,
        gamma=0.8,
    )
    reward = RewardConfig(press=1.0, mimic=0.0, hit=0.9)
    env = EnvConfig(action=ActionConfig(factor=0.06), reward=reward)
    steps = 18 * 464 if method == "ppo" else 3000
    config = ExpertConfig(method=method, total_steps=steps, env=env, ppo=ppo)  # type: ignore[arg-type]
    run = train_expert(demo, tmp_path / "run", config, threads=1)
    silent = 1.0 - float(run.demonstration.score.roll().any(axis=1).mean())
    if method == "ppo":
        assert run.curve()[0].recall == pytest.approx(silent)
    assert run.best()[1]["recall"] > silent + 0.3
    assert run.best()[1]["precision"] > 0.9


@pytest.mark.parametrize("kind", ["paper", "odd"])
def test_configs_go_through_json(kind: str) -> None:
    config = (
        ExpertConfig()
        if kind == "paper"
        else ExpertConfig(ppo=PpoConfig(hidden=(8,), clip_range=1))
    )
    assert from_json(ExpertConfig, json.loads(json.dumps(to_json(config)))) == config


def test_runs_from_before_there_were_two_worlds_are_read_as_they_were() -> None:
    content = json.loads(json.dumps(to_json(ExpertConfig())))
    assert "world" not in content["env"]
    assert from_json(ExpertConfig, content).env.world == "paper"
    solid = dataclasses.replace(ExpertConfig(), env=EnvConfig(world="solid"))
    content = json.loads(json.dumps(to_json(solid)))
    assert content["env"]["world"] == "solid"
    assert from_json(ExpertConfig, content) == solid


@pytest.mark.parametrize(
    "change",
    [
        {"total_steps": "many"},
        {"total_steps": 0},
        {"method": "magic"},
        {"seed": None},
        {"more": 1},
        {"env": []},
    ],
)
def test_configs_of_another_kind_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(InputError):
        from_json(ExpertConfig, {**to_json(ExpertConfig()), **change})


def about(path: Path, **change: object) -> None:
    told = json.loads((path / "run.json").read_text())
    (path / "run.json").write_text(json.dumps({**told, **change}))


def test_folders_that_hold_something_else(
    demo: Path, two_notes: Demonstration, tmp_path: Path, small_search: ExpertConfig
) -> None:
    out = tmp_path / "run"
    train_expert(demo, out, small_search)
    with pytest.raises(InputError, match="seed: 0 there, 5 now"):
        train_expert(demo, out, dataclasses.replace(small_search, seed=5))
    other = tmp_path / "other.npz"
    two_notes.save(other)
    with pytest.raises(InputError, match="another song"):
        train_expert(other, out, small_search)
    with pytest.raises(InputError, match="something else"):
        train_expert(demo, tmp_path, small_search)
    with pytest.raises(InputError, match="is a file"):
        train_expert(demo, demo, small_search)
    (out / "state.safetensors").write_bytes(b"cut")
    with pytest.raises(InputError, match="damaged"):
        train_expert(demo, out, small_search)
    (out / "result.safetensors").write_bytes((out / "result.safetensors").read_bytes()[:99])
    with pytest.raises(InputError, match="damaged"):
        load_expert(out)
    about(out, run_version=99)
    with pytest.raises(InputError, match="version 99; this program reads 3"):
        load_expert(out)
    with pytest.raises(InputError, match="not the folder of a run"):
        load_expert(tmp_path)


def test_songs_that_nothing_can_be_learned_on(
    two_notes: Demonstration, tmp_path: Path, small_search: ExpertConfig
) -> None:
    short, odd, long = (tmp_path / f"{name}.npz" for name in ("short", "odd", "long"))
    two_notes.save(short)
    with pytest.raises(InputError, match="a second at least"):
        train_expert(short, tmp_path / "run", small_search, seconds=0.5)
    np.savez(odd, fingertips=np.zeros(3))
    with pytest.raises(InputError, match="not a demonstration"):
        train_expert(odd, tmp_path / "run", small_search)
    with np.load(short) as file:
        arrays = dict(file)
    blind = {**arrays, "plan_fingertips": np.full_like(arrays["plan_fingertips"], np.nan)}
    np.savez(odd, **blind)
    with pytest.raises(InputError, match="not a demonstration"):
        train_expert(odd, tmp_path / "run", small_search)
    np.savez(long, **{**arrays, "score_offset": arrays["score_offset"] + 1.0})
    with pytest.raises(InputError, match="not a demonstration"):
        train_expert(long, tmp_path / "run", small_search)
    idle = FingertipPlan(
        two_notes.plan.fingertips,
        np.full_like(two_notes.plan.finger_key, -1),
        np.full(2, -1, np.int8),
        np.full(2, -1, np.int8),
    )
    dataclasses.replace(two_notes, plan=idle).save(odd)
    with pytest.raises(InputError, match="no finger presses"):
        train_expert(odd, tmp_path / "run", small_search)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"total_steps": 0}, "total-steps must be 1 or more"),
        ({"seed": -1}, "seed must be 0 to 4294967295"),
        ({"ppo": {"num_envs": 3}}, "multiple"),
        ({"ppo": {"batch_size": 1}}, "ppo.batch-size"),
        ({"ppo": {"batch_size": 4096}}, "ppo.batch-size"),
        ({"ppo": {"evaluate_every": 0}}, "ppo.evaluate-every must be 1 or more"),
        ({"ppo": {"initial_std": 0.0}}, "ppo.initial-std must be more than 0"),
        ({"ppo": {"learning_rate": float("nan")}}, "ppo.learning-rate"),
        ({"ppo": {"hidden": (0,)}}, "ppo.hidden"),
        ({"ppo": {"gamma": 1.5}}, "ppo.gamma must be 0 to 1"),
        ({"ppo": {"activation": "step"}}, "ppo.activation must be one of gelu, relu, tanh"),
        ({"method": "magic"}, "method must be one of ppo, search"),
        ({"method": "search", "search": {"sizes": ()}}, "search.sizes"),
        ({"method": "search", "search": {"ahead": 0}}, "search.ahead must be 1 or more"),
    ],
)
def test_settings_that_do_not_fit(
    small_ppo: ExpertConfig, change: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        dataclasses.replace(
            small_ppo,
            **{
                name: dataclasses.replace(getattr(small_ppo, name), **value)
                if isinstance(value, dict)
                else value
                for name, value in change.items()
            },
        )
