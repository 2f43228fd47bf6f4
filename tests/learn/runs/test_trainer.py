"""The training loop: what it computes, and that nothing that interrupts it changes that."""

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
from torch import nn
from toy_training import CONFIG, error, loss, network, sample_batch, stop_at, train

from pianomime.errors import InputError, TrainingDiverged
from pianomime.learn.runs import run as run_module
from pianomime.learn.runs.run import RunFolder
from pianomime.learn.runs.trainer import learning_rate, load_weights
from pianomime.learn.runs.trainer_config import TrainerConfig
from pianomime.staging import claim


def bits(folder: Path) -> dict[str, bytes]:
    return {name: array.tobytes() for name, array in RunFolder.load(folder).result()[0].items()}


def change(**fields: Any) -> TrainerConfig:
    return dataclasses.replace(CONFIG, **fields)


def test_it_learns(tmp_path: Path) -> None:
    told: list[tuple[str, int, int, str]] = []
    before = error(network())["error"]
    module = train(tmp_path / "run", evaluate=error, progress=lambda *step: told.append(step))
    assert error(module)["error"] < 0.06 < before / 5
    # What is in the module is what is in the file, and was measured.
    assert not module.training
    read = network()
    load_weights(tmp_path / "run", read)
    assert error(read) == error(module) == RunFolder.load(tmp_path / "run").result()[1]
    assert {tensor.dtype for tensor in read.state_dict().values()} == {torch.float32}
    assert told[-1][:3] == ("training", CONFIG.steps, CONFIG.steps)
    assert "loss" in told[-1][3]
    assert [step[1] for step in told] == sorted(step[1] for step in told)


def test_it_computes_what_a_loop_written_by_hand_does(tmp_path: Path) -> None:
    config = change(steps=60, weight_decay=0.1, ema_power=0.6)
    made = train(tmp_path / "run", config)

    module = network()
    optimizer = torch.optim.AdamW(module.parameters(), lr=0.0, weight_decay=0.1, foreach=False)
    average = [parameter.detach().clone() for parameter in module.parameters()]
    for step in range(config.steps):
        arrays = sample_batch(np.random.default_rng([config.seed, step]), config.batch)
        batch = {name: torch.tensor(array) for name, array in arrays.items()}
        seed = np.random.SeedSequence([config.seed, step, 1]).generate_state(1)[0]
        torch.manual_seed(int(seed))
        optimizer.zero_grad()
        loss(module, batch).backward()
        norm = torch.cat([p.grad.flatten() for p in module.parameters()]).norm()
        for parameter in module.parameters():
            parameter.grad *= min(1.0, 1.0 / float(norm + 1e-6))
        optimizer.param_groups[0]["lr"] = learning_rate(config, step)
        optimizer.step()
        # The first update counts for nothing before it.
        decay = 1 - (1 + step) ** -0.6 if step else 0.0
        for mean, parameter in zip(average, module.parameters(), strict=True):
            mean.mul_(decay).add_((1 - decay) * parameter.detach())
    for mean, parameter in zip(average, made.parameters(), strict=True):
        torch.testing.assert_close(mean, parameter.detach(), rtol=1e-4, atol=1e-5)


def test_the_learning_rate_rises_and_falls() -> None:
    config = TrainerConfig(steps=1000, learning_rate=1.0, warmup=100)
    rates = [learning_rate(config, step) for step in range(1000)]
    assert np.argmax(rates) == 100
    assert (np.diff(rates[:101]) > 0).all()
    assert (np.diff(rates[100:]) < 0).all()
    assert max(rates) == 1.0
    assert 0 < rates[0] < 0.02
    assert rates[550] == pytest.approx(0.5)
    assert 0 < rates[-1] < 1e-4


@pytest.mark.parametrize("bfloat16", [False, True])
def test_same_seed_same_bits_however_often_it_is_interrupted(
    tmp_path: Path, bfloat16: bool
) -> None:
    config = change(steps=60, bfloat16=bfloat16)
    train(tmp_path / "whole", config)
    train(tmp_path / "same", change(steps=60, bfloat16=bfloat16, checkpoint_seconds=60.0))
    train(tmp_path / "other", change(steps=60, bfloat16=bfloat16, seed=1))
    assert bits(tmp_path / "whole") == bits(tmp_path / "same") != bits(tmp_path / "other")
    for step in (1, 2, 24, 13):
        with pytest.raises(KeyboardInterrupt):
            train(tmp_path / "parts", config, loss=stop_at(step, KeyboardInterrupt()))
        with pytest.raises(InputError, match="not trained to the end"):
            load_weights(tmp_path / "parts", network())
    state = RunFolder.load(tmp_path / "parts").state()
    assert state is not None
    # Of each part, all but the update that was interrupted.
    assert state.steps == 0 + 1 + 23 + 12
    train(tmp_path / "parts", config)
    assert bits(tmp_path / "parts") == bits(tmp_path / "whole")
    # There is nothing left to do.
    train(tmp_path / "parts", config, loss=stop_at(1, AssertionError()))


def test_evaluations_see_averaged_weights_and_change_nothing(tmp_path: Path) -> None:
    seen: list[dict[str, torch.Tensor]] = []

    def look(module: nn.Module) -> dict[str, float]:
        assert not module.training
        torch.rand(3)
        seen.append({name: tensor.clone() for name, tensor in module.state_dict().items()})
        return error(module)

    config = change(steps=60, evaluate_every=25)
    train(tmp_path / "watched", config, evaluate=look)
    train(tmp_path / "alone", config)
    assert bits(tmp_path / "watched") == bits(tmp_path / "alone")
    assert len(seen) == 3
    final = RunFolder.load(tmp_path / "watched").result()[0]
    assert all((tensor.numpy() == final[name]).all() for name, tensor in seen[-1].items())
    assert not all((tensor.numpy() == final[name]).all() for name, tensor in seen[0].items())


def test_a_killed_training_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    steps = 2000
    script = f"import toy_training; toy_training.long_run({str(tmp_path / 'killed')!r}, {steps})"
    places = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    process = subprocess.Popen(
        [sys.executable, "-c", script], env={**os.environ, "PYTHONPATH": places}
    )
    while process.poll() is None and not (tmp_path / "killed/state.safetensors").exists():
        time.sleep(0.002)
    time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    state = RunFolder.load(tmp_path / "killed").state()
    assert state is not None
    assert 0 < state.steps < steps
    config = change(steps=steps, checkpoint_seconds=60.0)
    train(tmp_path / "killed", config)
    train(tmp_path / "whole", config)
    assert bits(tmp_path / "killed") == bits(tmp_path / "whole")
    assert not [name for name in os.listdir(tmp_path / "killed") if name.startswith(".")]


@pytest.mark.parametrize("seconds", [0.0, 60.0])
def test_a_loss_that_is_no_number_stops_it(tmp_path: Path, seconds: float) -> None:
    def diverging(module: nn.Module, batch: dict[str, torch.Tensor]) -> torch.Tensor:
        calls.append(1)
        return loss(module, batch) * (float("nan") if len(calls) == 5 else 1.0)

    calls: list[int] = []
    with pytest.raises(TrainingDiverged, match="at step 5:"):
        train(tmp_path / "run", change(steps=60, checkpoint_seconds=seconds), loss=diverging)
    state = RunFolder.load(tmp_path / "run").state()
    if seconds:
        assert state is None
    else:
        assert state is not None
        assert state.steps == 4
        assert all(np.isfinite(array).all() for array in state.arrays.values())


def test_a_gradient_that_is_no_number_stops_it(tmp_path: Path) -> None:
    def steep(module: nn.Module, batch: dict[str, torch.Tensor]) -> torch.Tensor:
        return (module(batch["x"]) * 0.0).sum().abs().sqrt()

    with pytest.raises(TrainingDiverged, match="at step 1:"):
        train(tmp_path / "run", change(steps=30), loss=steep)
    assert RunFolder.load(tmp_path / "run").state() is None


def test_a_full_disk_leaves_the_last_good_checkpoint(tmp_path: Path, full_disk: Any) -> None:
    config, out = change(steps=60), tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        train(out, config, loss=stop_at(9, KeyboardInterrupt()))

    with full_disk():
        train(out, config)
    state = RunFolder.load(out).state()
    assert state is not None
    assert state.steps == 8
    train(out, config)
    train(tmp_path / "whole", config)
    assert bits(out) == bits(tmp_path / "whole")


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"learning_rate": 0.5}, "trainer.learning_rate: 0.03 there, 0.5 now"),
        ({"steps": 90}, "trainer.steps: 30 there, 90 now"),
        ({"seed": 3}, "trainer.seed"),
    ],
)
@pytest.mark.parametrize("finished", [False, True])
def test_another_config_is_another_training(
    tmp_path: Path, other: dict[str, Any], message: str, finished: bool
) -> None:
    config = change(steps=30)
    if finished:
        train(tmp_path / "run", config)
    else:
        with pytest.raises(KeyboardInterrupt):
            train(tmp_path / "run", config, loss=stop_at(9, KeyboardInterrupt()))
    with pytest.raises(InputError, match=message):
        train(tmp_path / "run", dataclasses.replace(config, **other))


def test_what_else_the_weights_depend_on_is_kept_and_must_be_the_same(tmp_path: Path) -> None:
    about = {"network": {"wide": 16, "heads": (1, 2)}, "data": "abc"}
    config = change(steps=30)
    train(tmp_path / "run", config, depends_on=about)
    kept = RunFolder.load(tmp_path / "run").config
    assert kept["network"] == {"wide": 16, "heads": [1, 2]}
    assert kept["trainer"] == dataclasses.asdict(config)
    # What changes nothing may be another.
    free = dataclasses.replace(config, checkpoint_seconds=5.0, evaluate_every=7)
    train(tmp_path / "run", free, depends_on=about, loss=stop_at(1, AssertionError()))
    for wrong in ({**about, "data": "abd"}, {"data": "abc"}, {**about, "more": 1}, None):
        with pytest.raises(InputError, match="there"):
            train(tmp_path / "run", config, depends_on=wrong)


def test_folders_that_cannot_be_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config, out = change(steps=30), tmp_path / "run"
    with pytest.raises(InputError, match="not the folder of a run"):
        load_weights(out, network())
    with pytest.raises(KeyboardInterrupt):
        train(out, config, loss=stop_at(20, KeyboardInterrupt()))
    with pytest.raises(InputError, match="another network"):
        train(out, config, wide=8)
    whole = (out / "state.safetensors").read_bytes()
    (out / "state.safetensors").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"state\.safetensors: damaged"):
        train(out, config)
    (out / "state.safetensors").write_bytes(whole)
    monkeypatch.setattr(run_module, "_PATIENCE", 0.0)
    with claim(out), pytest.raises(InputError, match="another process"):
        train(out, config)
    train(out, config)
    with pytest.raises(InputError, match="another network"):
        load_weights(out, network(8))
    weights = (out / "result.safetensors").read_bytes()
    (out / "result.safetensors").write_bytes(weights[: len(weights) // 2])
    with pytest.raises(InputError, match=r"result\.safetensors: damaged"):
        train(out, config)
    told = json.loads((out / "run.json").read_text())
    (out / "run.json").write_text(json.dumps({**told, "run_version": 99}))
    with pytest.raises(InputError, match="version 99; this program reads 3"):
        train(out, config)
    for damaged in ("[]", "{", '{"kind": 1}', '{"run_version": 3}', ""):
        (out / "run.json").write_text(damaged)
        with pytest.raises(InputError, match=r"run\.json: damaged"):
            train(out, config)
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs/notes.txt").write_text("mine")
    with pytest.raises(InputError, match="something else"):
        train(tmp_path / "theirs", config)
    with pytest.raises(InputError, match="is a file"):
        train(tmp_path / "theirs/notes.txt", config)
    assert os.listdir(tmp_path / "theirs") == ["notes.txt"]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"steps": 0}, "trainer.steps must be 1 or more"),
        ({"batch": 0}, "trainer.batch must be 1 to 65536"),
        ({"learning_rate": float("nan")}, "trainer.learning-rate must be more than 0"),
        ({"warmup": -1}, "trainer.warmup must be 0 or more"),
        ({"ema_power": 0.0}, "trainer.ema-power must be more than 0"),
        ({"seed": -1}, "trainer.seed must be 0 to 4294967295"),
    ],
)
def test_settings_that_make_no_sense(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        change(**fields)


def test_a_short_training_has_a_short_warm_up() -> None:
    assert change(steps=100, warmup=500).warmup == 10
    assert change(steps=1, warmup=500).warmup == 0
    # What fits stays as it was asked for.
    assert change(steps=501, warmup=500).warmup == 500


def test_tensorboard_shows_each_step_once(tmp_path: Path) -> None:
    config = change(steps=60, evaluate_every=30)
    calls = 0

    def looking(module: nn.Module) -> dict[str, float]:
        nonlocal calls
        calls += 1
        # Ends after the figures of this step are written, before its checkpoint is.
        if calls == 1:
            raise KeyboardInterrupt
        return error(module)

    with pytest.raises(KeyboardInterrupt):
        train(tmp_path / "run", config, evaluate=looking)
    train(tmp_path / "run", config, evaluate=looking)
    log = EventAccumulator(str(tmp_path / "run/tensorboard"))
    log.Reload()
    for name in ("trainer/loss", "trainer/gradient_norm", "trainer/steps_per_second"):
        assert [event.step for event in log.Scalars(name)] == list(range(1, 61))
    assert [event.step for event in log.Scalars("error")] == [30, 60]
    rates = [event.value for event in log.Scalars("trainer/learning_rate")]
    assert rates == pytest.approx([learning_rate(config, step) for step in range(60)])


def test_the_loss_of_held_out_samples_is_measured_and_changes_nothing(tmp_path: Path) -> None:
    config = change(steps=60, evaluate_every=30)
    held_out = sample_batch(np.random.default_rng(9), 64)
    made = train(tmp_path / "run", config, held_out=held_out)
    train(tmp_path / "alone", config)
    assert bits(tmp_path / "run") == bits(tmp_path / "alone")
    torch.manual_seed(0)
    batch = {name: torch.from_numpy(array) for name, array in held_out.items()}
    measured = RunFolder.load(tmp_path / "run").result()[1]["trainer/validation_loss"]
    assert measured == pytest.approx(loss(made, batch).item(), rel=1e-5)
    log = EventAccumulator(str(tmp_path / "run/tensorboard"))
    log.Reload()
    assert [event.step for event in log.Scalars("trainer/validation_loss")] == [30, 60]
