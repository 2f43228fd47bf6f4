"""The summarize of a performance, as `report.json` and a row of `results.json` hold them."""

from __future__ import annotations

from pianomime.players.performance import Performance

Row = dict[str, str | int | float]
"""The summarize of one song."""


def summarize(performance: Performance) -> Row:
    """The summarize of a performance.

    Args:
        performance: any performance.

    Returns:
        `song`, `player`, `effort`; `song_seconds`, `frames`; the metrics `precision`, `recall`,
        `f1`, `onset_f1`, `pedal_f1` (0..1); `plan_seconds`, `simulate_seconds` and
        `realtime_factor` (their sum into `song_seconds`, higher is better); `notes` of the score
        and `dropped_notes` that the planner left out; `blow_ups`, frames in which the physics
        broke.
    """
    return {
        "song": performance.score.title,
        "player": performance.player,
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
    }
