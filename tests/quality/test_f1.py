"""How well songs are played: what makes the F1 cannot be taken away unnoticed.

`python benchmarks/digest.py --write` makes the stored table anew.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from pianomime import Score, excerpt, load_player, songs

TOLERANCE = 0.003
"""Of the F1: controls may differ in the last bit from one kind of processor to another."""
TABLE = json.loads(Path(__file__).with_name("f1.json").read_text("utf-8"))
BUNDLED = [row for row in TABLE if row["song"] in songs.names()]
REFERENCE = [row for row in TABLE if row["song"] not in songs.names()]


def f1(row: dict[str, Any], path: Path) -> float:
    player = load_player("zero-shot", row["effort"])
    score = excerpt(Score.from_midi(path), seconds=row["seconds"])
    return player.play(score).metrics()["f1"]


def test_the_table_holds_what_it_should() -> None:
    assert {row["song"] for row in BUNDLED if row["effort"] == 0} == set(songs.names())
    assert sum(row["effort"] == 1 for row in BUNDLED) == 2
    assert len(REFERENCE) == 6


@pytest.mark.parametrize("row", BUNDLED, ids=lambda row: f"{row['song']}-{row['effort']}")
def test_bundled_songs_are_played_as_well_as_before(row: dict[str, Any]) -> None:
    assert f1(row, songs.path(row["song"])) == pytest.approx(row["f1"], abs=TOLERANCE)


@pytest.mark.parametrize("row", REFERENCE, ids=lambda row: Path(row["song"]).stem)
def test_reference_songs_are_played_as_well_as_before(row: dict[str, Any], shared: Path) -> None:
    """The bundled songs alone mislead: without the lift of fingers astray they gain 0.01."""
    assert f1(row, shared / row["song"]) == pytest.approx(row["f1"], abs=TOLERANCE)
