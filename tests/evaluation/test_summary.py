"""The row of a performance, value by value, and what `evaluate` makes of rows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import made_up
from pianomime import evaluate
from pianomime.errors import InputError
from pianomime.evaluation.evaluation import markdown
from pianomime.evaluation.summary import summarize


def test_a_row_holds_what_was_measured_rounded() -> None:
    performance = replace(
        made_up.performance(made_up.score(40, 6.0, title="étude")),
        plan_seconds=0.123456,
        simulate_seconds=1.234567,
        blow_ups=np.array([3, 5, 8]),
    )
    metrics = performance.metrics()
    frames = performance.score.frames()
    assert summarize(performance) == {
        "song": "étude",
        "player": "made up",
        "effort": 2,
        "song_seconds": round(frames / 20, 3),
        "frames": frames,
        **{name: round(value, 6) for name, value in metrics.items()},
        "plan_seconds": 0.123,
        "simulate_seconds": 1.235,
        "realtime_factor": round(frames / 20 / (0.123456 + 1.234567), 3),
        "notes": 40,
        "dropped_notes": 1,
        "blow_ups": 3,
        "remarks": [],
    }
    assert len({round(value, 3) == round(value, 6) for value in metrics.values()}) == 2


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan")])
def test_no_time_at_all_is_refused(seconds: float) -> None:
    with pytest.raises(InputError, match="seconds must be more than 0"):
        evaluate("ode-to-joy", seconds=seconds)


@pytest.mark.parametrize("jobs", [0, -1])
def test_no_process_at_all_is_refused(jobs: int) -> None:
    with pytest.raises(InputError, match="jobs must be 1 or more"):
        evaluate("ode-to-joy", jobs=jobs)


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(InputError, match="is a file"):
        evaluate("ode-to-joy", out=tmp_path / "out")


def test_the_table_line_by_line() -> None:
    row: dict[str, Any] = {
        "song": "a|b",
        "f1": 0.91,
        "precision": 0.92,
        "recall": 0.93,
        "onset_f1": 0.94,
        "pedal_f1": 0.95,
        "realtime_factor": 2.06,
        "notes": 12,
        "dropped_notes": 3,
        "blow_ups": 1,
    }
    mean = {name: value for name, value in row.items() if name != "song"}
    lines = markdown(
        {
            "songs": [row, {"song": "c", "error": "d|e"}],
            "mean": mean,
            "causes": {
                "missed": {"pressed late": 0.25, "not planned": 0.0625},
                "wrong": {"pressed early": 0.125},
            },
        }
    ).splitlines()
    numbers = "0.910 | 0.920 | 0.930 | 0.940 | 0.950 | 2.1x"
    assert lines[2:] == [
        f"| a\\|b | {numbers} | 3/12 | 1 |",
        "| c | failed: d\\|e | | | | | | | |",
        f"| **mean** | {numbers} | 3.0/12.0 | 1.0 |",
        "",
        "| cause | | of the key-frames wanted |",
        "| --- | --- | ---: |",
        "| pressed late | missed | 25.00% |",
        "| pressed early | wrong | 12.50% |",
        "| not planned | missed | 6.25% |",
    ]
