"""A sample of benchmarks/fidelity.py: the paper's experts play and are predicted in our world."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def fidelity() -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        return importlib.import_module("fidelity")


@pytest.fixture(scope="module")
def clips(fidelity: ModuleType, shared: Path) -> list[Any]:
    return list(fidelity.clips(shared, every=25))


def test_experts_play_open_loop(fidelity: ModuleType, clips: list[Any]) -> None:
    f1, blow_ups = zip(
        *((metrics.f1, broken) for metrics, broken in map(fidelity.replay, clips[::3])), strict=True
    )
    assert np.mean(f1) >= 0.88  # 0.905 measured, over these three clips
    assert sum(blow_ups) == 0


def test_one_step_ahead(fidelity: ModuleType, clips: list[Any]) -> None:
    errors = np.concatenate([fidelity.one_step_errors(clip, every=60) for clip in clips])
    assert np.median(errors) <= 2e-4


def test_experts_stay_near_the_base_controller(fidelity: ModuleType, clips: list[Any]) -> None:
    near = np.concatenate([fidelity.near_base(clip, every=10) for clip in clips])
    assert near.mean() >= 0.99
