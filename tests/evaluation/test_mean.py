"""Means over songs leave out what could not be measured, and say of how many songs they are."""

from __future__ import annotations

from typing import Any

import pytest

from pianomime.evaluation.mean import mean
from pianomime.schema import Field, Schema

NUMBER = Field("float", (), may_be_null=True)
SCHEMA: dict[str, Schema] = {
    "song": Field("text"),
    "f1": NUMBER,
    "pedal": Field("float", (), optional=True),
    "music": {"restruck": NUMBER, "error": Field("float", (3,), may_be_null=True)},
    "remarks": Field("text", ("R",)),
}


def row(f1: float | None, restruck: float | None, error: list[float] | None, **more: Any) -> Any:
    music = {"restruck": restruck, "error": error}
    return {"song": "a", "f1": f1, "music": music, "remarks": ["b"], **more}


def test_what_could_not_be_measured_is_left_out() -> None:
    rows = [row(0.5, None, [1, 2, 3]), row(1.0, 0.25, None), row(0.0, None, [3, 4, 8])]
    value, songs = mean(rows, SCHEMA)
    assert value == {"f1": 0.5, "music": {"restruck": 0.25, "error": [2.0, 3.0, 5.5]}}
    assert songs == {"f1": 3, "music": {"restruck": 1, "error": 2}}


def test_what_no_song_has_has_no_mean() -> None:
    value, songs = mean([row(None, None, None)], SCHEMA)
    assert value == {"f1": None, "music": {"restruck": None, "error": None}}
    assert songs == {"f1": 0, "music": {"restruck": 0, "error": 0}}
    assert mean([], SCHEMA) == ({}, {})


def test_an_optional_value_is_that_of_the_songs_that_have_it() -> None:
    value, songs = mean([row(1, 1, None, pedal=0.5), row(1, 1, None)], SCHEMA)
    assert (value["pedal"], songs["pedal"]) == (0.5, 1)


def test_means_are_rounded_as_rows_are() -> None:
    assert mean([1.0, 0.0, 0.0], NUMBER).value == pytest.approx(1 / 3, abs=5e-7)
    assert len(str(mean([1.0, 0.0, 0.0], NUMBER).value)) == len("0.333333")
