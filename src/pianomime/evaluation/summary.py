"""Summary of a performance: the content of `report.json`, and a row of `results.json`."""

from __future__ import annotations

from typing import Any

from pianomime.players.performance import Performance
from pianomime.schema import Field, Schema
from pianomime.shown import shown

Row = dict[str, Any]
"""Values of one song by name: its summary, or an error."""

_COUNT, _SECONDS, _SHARE = Field("int", (), 0), Field("float", (), 0), Field("float", (), 0, 1)
ROW_SCHEMA: dict[str, Schema] = {
    "song": Field("text"),
    "player": Field("text"),
    "effort": _COUNT,
    "song_seconds": _SECONDS,
    "frames": _COUNT,
    **dict.fromkeys(("precision", "recall", "f1", "onset_f1", "pedal_f1"), _SHARE),
    **dict.fromkeys(("plan_seconds", "simulate_seconds", "realtime_factor"), _SECONDS),
    **dict.fromkeys(("notes", "dropped_notes", "blow_ups"), _COUNT),
    "remarks": Field("text", ("R",), optional=True),
}
"""Schema of a summary."""


def summarize(performance: Performance) -> Row:
    """Summarize a performance in one row.

    Args:
        performance: any performance.

    Returns:
        `song`, `player` and `effort`; `song_seconds` and `frames`; the metrics `precision`,
        `recall`, `f1`, `onset_f1` and `pedal_f1`, 0..1; `plan_seconds`, `simulate_seconds` and
        `realtime_factor`, which is `song_seconds` divided by their sum; `notes` of the score and
        `dropped_notes`, those that the planner did not plan; `blow_ups`, the number of frames in
        which the physics became unstable; `remarks`, what was mended or left out when the score was
        read.
    """
    return {
        "song": performance.score.title,
        "player": shown(performance.player),
        "effort": performance.effort,
        "song_seconds": round(performance.song_seconds, 3),
        "frames": len(performance),
        **{name: round(value, 6) for name, value in performance.metrics().items()},
        "plan_seconds": round(performance.plan_seconds, 3),
        "simulate_seconds": round(performance.simulate_seconds, 3),
        "realtime_factor": round(performance.realtime_factor, 3),
        "notes": len(performance.score.key),
        "dropped_notes": performance.dropped_notes,
        "blow_ups": len(performance.blow_ups),
        "remarks": list(performance.score.remarks),
    }
