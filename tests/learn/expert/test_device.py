"""Experts that learn in worlds on another device."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pianomime.cli import main
from pianomime.errors import InputError
from pianomime.learn.envs.batch import SongBatch
from pianomime.learn.envs.config import EnvConfig
from pianomime.learn.expert.config import ExpertConfig
from pianomime.learn.expert.expert import train_expert
from pianomime.plan.demonstration import Demonstration


def test_an_expert_learns_on_it(
    shallow: Demonstration, tmp_path: Path, small_ppo: ExpertConfig
) -> None:
    """One update of PPO, which a second call finds done, and a third one goes on from."""
    pytest.importorskip("mujoco_warp", reason="the extra gpu is not installed")
    demo = tmp_path / "demo.npz"
    shallow.save(demo)
    steps = small_ppo.ppo.steps_per_update
    config = dataclasses.replace(small_ppo, total_steps=steps, env=EnvConfig(device="warp-cpu"))
    run = train_expert(demo, tmp_path / "run", config, threads=1)
    assert run.steps_done == steps
    same = train_expert(demo, tmp_path / "run", config, threads=1)
    assert same.curve() == run.curve()
    longer = dataclasses.replace(config, total_steps=2 * steps)
    more = train_expert(demo, tmp_path / "run", longer, threads=1)
    assert more.steps_done == 2 * steps


def test_an_environment_on_it_is_nearly_the_same(shallow: Demonstration) -> None:
    pytest.importorskip("mujoco_warp", reason="the extra gpu is not installed")
    rng = np.random.default_rng(0)
    batches = [
        SongBatch(shallow, EnvConfig(device=device), num_envs=2, threads=1)
        for device in ("cpu", "warp-cpu")
    ]
    for batch in batches:
        batch.reset(rng)
    for _ in range(5):
        action = rng.uniform(-1.0, 1.0, (2, batches[0].action_size))
        rewards = [batch.step(action).reward for batch in batches]
        np.testing.assert_allclose(*rewards, atol=0.02)
        observed, reference = (batch.observations for batch in reversed(batches))
        assert np.median(np.abs(observed - reference)) < 1e-4


def test_a_search_is_on_the_processor() -> None:
    with pytest.raises(InputError, match=r"env\.device cuda needs method ppo"):
        ExpertConfig(method="search", env=EnvConfig(device="cuda"))


def test_a_missing_package_is_told_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def without_warp(name: str) -> Any:
        # As if the other one were there, whether it is or not.
        if name in ("warp", "mujoco_warp"):
            return find_spec("json") if name == "warp" else None
        return find_spec(name)

    monkeypatch.setattr("pianomime.world.device_batch.find_spec", without_warp)
    out = tmp_path / "run"
    with pytest.raises(SystemExit) as ended:
        main(["train-expert", "ode-to-joy", "-o", str(out), "--env.device", "cuda"])
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert "mujoco_warp" in told
    assert "[gpu]" in told
    assert "Traceback" not in told
    assert not out.exists()


def test_a_missing_gpu_is_told_before_any_work(tmp_path: Path) -> None:
    """In a process of its own: Warp says what it lacks once in each, and not through Python."""
    pytest.importorskip("mujoco_warp", reason="the extra gpu is not installed")
    warp = pytest.importorskip("warp")
    if warp.is_cuda_available():
        pytest.skip("there is a GPU")
    out = tmp_path / "run"
    command = ["train-expert", "ode-to-joy", "-o", str(out), "--env.device", "cuda"]
    done = subprocess.run(
        [sys.executable, "-m", "pianomime", *command], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "needs a GPU of NVIDIA" in line
    assert not out.exists()
