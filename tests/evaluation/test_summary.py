"""The row of a performance, value by value, and what `evaluate` makes of rows."""

from __future__ import annotations

import json
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import made_up
from pianomime import evaluate
from pianomime.errors import InputError
from pianomime.evaluation.summary import (
    BODY_SCHEMA,
    MUSIC_SCHEMA,
    ROW_SCHEMA,
    json_of,
    summarize,
)
from pianomime.evaluation.table import markdown
from pianomime.music import MusicMetrics, Score, protocol_digest
from pianomime.players.body import BodyMetrics, body_metrics
from pianomime.schema import check_json


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
        "protocol": protocol_digest(),
        "touch": "goebl-bresin",
        "world": "paper",
        "music": json_of(asdict(performance.music())),
        "body": json_of(asdict(body_metrics(performance))),
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


def test_a_row_fits_its_schema() -> None:
    row = summarize(made_up.performance(made_up.score(40, 6.0)))
    check_json(json.loads(json.dumps(row)), ROW_SCHEMA)
    silent = Score(np.array([40]), np.array([0.0]), np.array([1.0]), np.array([64]))
    nothing_played = made_up.performance(silent, mistakes=2.0)
    row = summarize(nothing_played)
    check_json(json.loads(json.dumps(row)), ROW_SCHEMA)
    assert row["music"]["restruck"] is None
    assert set(MUSIC_SCHEMA) == {field.name for field in fields(MusicMetrics)}
    assert set(BODY_SCHEMA) == {field.name for field in fields(BodyMetrics)}


def test_metrics_as_json() -> None:
    nested = {"a": (1 / 3, None, 2), "b": {"c": "d", "e": ()}}
    assert json_of(nested) == {"a": [0.333333, None, 2], "b": {"c": "d", "e": []}}


def test_the_tables_line_by_line() -> None:
    row: dict[str, Any] = {
        "song": "a|b",
        "f1": 0.91,
        "precision": 0.92,
        "recall": 0.93,
        "realtime_factor": 2.06,
        "notes": 12,
        "dropped_notes": 3,
        "blow_ups": 1,
        "music": {
            "note_f1_50": 0.81,
            "note_f1_25": 0.82,
            "note_f1_10": 0.83,
            "note_offset_f1_50": 0.84,
            "velocity_f1": 0.85,
            "phantoms_per_minute": 5.55,
            "restruck": None,
            "chord_spread_p90_ms": 12.4,
            "onset_error_ms": [-10.2, 0.4, 30.0],
        },
        "body": {
            "hands_overlap": 0.0625,
            "fingers_overlap": 0.5,
            "forearms_crossed": 0.0,
            "joints_fast": None,
            "rail_speed_max": 1.234,
            "rail_force_max": 99.6,
        },
    }
    mean = {name: value for name, value in row.items() if name != "song"}
    mean |= {"notes": 12.0, "dropped_notes": 3.0, "blow_ups": 1.0}
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
    music = "0.810 | 0.820 | 0.830 | 0.840 | 0.850 | 5.5 | - | 12 | -10, +0, +30"
    frames = "0.910 | 0.920 | 0.930 | 2.1x"
    body = "6.2% | 50.0% | 0.0% | - | 1.23 | 100"
    heads = [line for line in lines if line.startswith("| song")]
    assert [head.count("|") for head in heads] == [11, 8, 8]
    assert heads[0].startswith("| song | note F1, 50 ms | note F1, 25 ms | ")
    assert [line for line in lines if line not in heads and not line.startswith("| ---")] == [
        f"| a\\|b | {music} |",
        f"| c | failed: d\\|e {'| ' * 8}|",
        f"| **mean** | {music} |",
        "",
        f"| a\\|b | {frames} | 3/12 | 1 |",
        f"| **mean** | {frames} | 3.0/12.0 | 1.0 |",
        "",
        f"| a\\|b | {body} |",
        f"| **mean** | {body} |",
        "",
        "| cause | | of the key-frames wanted |",
        "| pressed late | missed | 25.00% |",
        "| pressed early | wrong | 12.50% |",
        "| not planned | missed | 6.25% |",
    ]
