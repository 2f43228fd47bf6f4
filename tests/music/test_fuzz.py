"""A short run of benchmarks/fuzz_midi.py: any bytes are read, or refused in one line."""

import importlib
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def test_any_bytes_are_read_or_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)
    counts, faults = importlib.import_module("fuzz_midi").fuzz(500, seed=1)
    assert faults == {}
    assert sum(counts.values()) == 500
    assert min(counts.values()) > 10
