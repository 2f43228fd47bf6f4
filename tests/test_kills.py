"""A short run of benchmarks/kills.py: a command that is killed leaves nothing and loses nothing."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.mark.skipif(sys.platform != "linux", reason="it finds processes as Linux lists them")
def test_a_command_that_is_killed_leaves_nothing_and_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)
    kills = importlib.import_module("kills")
    tally = kills.tried(["import-demos"], 2, 0, tmp_path, None)["import-demos"]
    assert tally.failures == []
    assert tally.kills == {"SIGKILL": 1, "SIGTERM": 1, "SIGINT": 0}
