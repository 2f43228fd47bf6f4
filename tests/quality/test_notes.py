"""How well notes are played: time, touch and wrong strikes cannot become worse unnoticed.

As in test_f1.py, what is stored is what songs come to on many processors: the mean and the worst of
many plays with plans that differ in the last bits. Here it is how well an ear would find that notes
are played by the zero-shot player.

`python benchmarks/stored_notes.py` makes the stored table anew.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import pytest

from pianomime import Score, excerpt, load_player, songs
from pianomime.music.protocol import MusicMetrics, music_metrics

TOLERANCE = {
    "note_f1_50": 0.01,
    "note_f1_25": 0.02,
    "velocity_f1": 0.02,
    "phantoms_per_minute": 4.0,
}
"""By measure: by how much a song may be worse than the worst stored play, for there are more
processors than plays. One strike in 15 s is 4 a minute."""
BAND = {
    "note_f1_50": 0.003,
    "note_f1_25": 0.005,
    "velocity_f1": 0.01,
    "phantoms_per_minute": 0.6,
}
"""By how much the mean of the bundled songs may be worse than that of the stored means, which does
not move with the last bits: by one strike in one of seven songs."""
WORSE = {"phantoms_per_minute": 1.0}
"""1 for measures of which more is worse; -1 for all others."""


class Row(NamedTuple):
    """A row of the table."""

    song: str
    effort: int
    seconds: float
    lead_in: float


STORED: list[dict[str, Any]] = json.loads(Path(__file__).with_name("notes.json").read_text("utf-8"))
TABLE = {Row(*(row[name] for name in Row._fields)): row for row in STORED}
BUNDLED = [row for row in TABLE if row.song in songs.names()]
REFERENCE = [row for row in TABLE if row.song not in songs.names()]


@cache
def played(row: Row, path: Path) -> MusicMetrics:
    score = excerpt(Score.from_midi(path), seconds=row.seconds, lead_in=row.lead_in)
    return music_metrics(score, load_player("zero-shot", row.effort).play(score).played())


def loss(row: Row, path: Path, name: str, than: str) -> float:
    """How much worse a measure is than what is stored of it."""
    return WORSE.get(name, -1.0) * (getattr(played(row, path), name) - TABLE[row][name][than])


def test_the_table_holds_what_it_should() -> None:
    assert {row.song for row in BUNDLED if row.effort == 0} == set(songs.names())
    assert sum(row.effort == 1 for row in BUNDLED) == 2
    assert len(REFERENCE) == 4
    for row in TABLE.values():
        assert all(
            row[name]["worst"] <= row[name]["mean"] for name in TOLERANCE if name not in WORSE
        )
        assert all(row[name]["worst"] >= row[name]["mean"] for name in WORSE)


@pytest.mark.parametrize("name", TOLERANCE)
@pytest.mark.parametrize("row", BUNDLED, ids=lambda row: f"{row.song}-{row.effort}")
def test_bundled_songs_are_played_as_well_as_before(row: Row, name: str) -> None:
    assert loss(row, songs.path(row.song), name, "worst") <= TOLERANCE[name]


@pytest.mark.parametrize("name", BAND)
@pytest.mark.parametrize("effort", [0, 1])
def test_bundled_songs_are_played_as_well_on_average(effort: int, name: str) -> None:
    rows = [row for row in BUNDLED if row.effort == effort]
    assert fmean(loss(row, songs.path(row.song), name, "mean") for row in rows) <= BAND[name]


@pytest.mark.parametrize("name", TOLERANCE)
@pytest.mark.parametrize("row", REFERENCE, ids=lambda row: Path(row.song).stem)
def test_reference_songs_are_played_as_well_as_before(row: Row, name: str, shared: Path) -> None:
    assert loss(row, shared / row.song, name, "worst") <= TOLERANCE[name]
