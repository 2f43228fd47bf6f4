"""What `evaluate --robust` has its worker processes do: play a song in worlds that differ."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from pianomime.evaluation.robust_grid import GRID
from pianomime.evaluation.robust_play import CLOSED, OPEN, replayed, tracked
from pianomime.players.performance import Performance
from pianomime.schema import Field, Schema
from pianomime.track.nominal_tracking import Reference

ROBUST_WORKER = "pianomime.evaluation.robust_worker:load_robust_worker"
"""`load_robust_worker`, for `pianomime.workers`."""

_SCORE = Field("float", (), 0, 1, may_be_null=True)
MEASURES = ("f1", "note_f1_50", "blow_ups")
"""Names of what is measured of a song in each case."""
NUMBERS: Schema = dict(zip(MEASURES, (_SCORE, _SCORE, Field("int", (), 0)), strict=True))
"""Their schema: F1 of frames, of notes within 50 ms, and the
number of frames in which the physics became unstable."""
ROBUST_ROW: Schema = {
    "song": Field("text"),
    OPEN: {case.name: NUMBERS for case in GRID if not case.sensed},
    CLOSED: {case.name: NUMBERS for case in GRID},
}
"""Schema of the row of a song: numbers by loop and case. Noise matters only to who looks."""


def load_robust_worker(setup: None) -> Callable[[dict[str, str]], dict[str, Any]]:
    """Give what answers requests of `song`, a title, and `performance`, the path of its file."""
    return lambda request: robust_row(request["song"], Path(request["performance"]))


def robust_row(song: str, path: Path) -> dict[str, Any]:
    """Play a performance in all worlds of the grid.

    Args:
        song: its title.
        path: of the performance, as it was in the nominal world.

    Returns:
        The row, of the schema `ROBUST_ROW`.

    Raises:
        InputError: the file is no performance, or damaged.
        OSError: it cannot be read.
    """
    performance = Performance.load(path)
    reference = Reference.of(performance.ctrl, performance.world)
    return {
        "song": song,
        OPEN: {
            case.name: _numbers(replayed(performance, case)) for case in GRID if not case.sensed
        },
        CLOSED: {case.name: _numbers(tracked(performance, reference, case)) for case in GRID},
    }


def _numbers(performance: Performance) -> dict[str, Any]:
    note = performance.music().note_f1_50
    return {
        "f1": round(performance.metrics()["f1"], 6),
        "note_f1_50": None if note is None else round(note, 6),
        "blow_ups": len(performance.blow_ups),
    }
