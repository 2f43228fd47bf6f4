"""A short run of benchmarks/tamper.py: whatever is damaged is refused in one line."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


def test_nothing_that_was_tampered_with_is_taken_for_true(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for extra in ("onnx", "torch", "zarr"):
        pytest.importorskip(extra)
    monkeypatch.syspath_prepend(BENCHMARKS)
    wrong: list[str] = []
    outcomes = importlib.import_module("tamper").tamper(130, seed=1, report=wrong.append)
    assert wrong == []
    assert sum(found["refused"] for found in outcomes.values()) > 60
