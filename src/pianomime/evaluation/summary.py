"""Summary of a performance: the content of `report.json`, and a row of `results.json`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from pianomime.music import protocol_digest
from pianomime.players.body import body_metrics
from pianomime.players.motion import FrameMotion
from pianomime.players.performance import Performance
from pianomime.schema import Field, Schema
from pianomime.shown import shown

Row = dict[str, Any]
"""Values of one song by name: its summary, or an error."""

_COUNT, _SECONDS, _SHARE = Field("int", (), 0), Field("float", (), 0), Field("float", (), 0, 1)
# Those that may have nothing to measure.
_RATIO, _AMOUNT = (
    Field("float", (), 0, 1, may_be_null=True),
    Field("float", (), 0, may_be_null=True),
)
_SCORES = [
    f"{what}_{part}_{tolerance}"
    for what in ("note", "note_offset")
    for tolerance in (50, 25, 10)
    for part in ("precision", "recall", "f1")
]
_VOICE: Schema = {"notes": _COUNT, "never_struck": _COUNT, "share": _RATIO}
MUSIC_SCHEMA: dict[str, Schema] = {
    **dict.fromkeys(("notes", "strikes", "phantoms", "repeats", "chords", "pedal_lifts"), _COUNT),
    **dict.fromkeys(_SCORES, _RATIO),
    **dict.fromkeys(("velocity_f1", "velocity_f1_rescaled"), _RATIO),
    "velocity_correlation": Field("float", (), -1, 1, may_be_null=True),
    **dict.fromkeys(("onset_error_ms", "offset_error_ms"), Field("float", (3,), may_be_null=True)),
    **dict.fromkeys(
        (
            "phantoms_per_minute",
            "chord_spread_p50_ms",
            "chord_spread_p90_ms",
            "chord_spread_wanted_p90_ms",
        ),
        _AMOUNT,
    ),
    **dict.fromkeys(("never_struck", "restruck", "pedal_lifts_kept", "key_time_f1"), _RATIO),
    **dict.fromkeys(("melody", "bass", "inner"), _VOICE),
}
"""Schema of `pianomime.music.MusicMetrics` as JSON."""
BODY_SCHEMA: dict[str, Schema] = {
    **dict.fromkeys(
        (
            "hands_overlap",
            "fingers_overlap",
            "forearms_crossed",
            "joints_fast",
            "controls_at_end",
            "controls_at_end_worst",
            "forces_at_limit",
            "forces_at_limit_worst",
        ),
        _RATIO,
    ),
    **dict.fromkeys(
        (
            "hands_overlap_max",
            "fingers_overlap_max",
            "joint_speed_p99",
            "joint_speed_max",
            "rail_speed_max",
            "rail_acceleration_max",
            "rail_force_max",
            "wrist_speed_p99",
            "wrist_jerk",
            "fingertip_jerk",
        ),
        _AMOUNT,
    ),
    "invalid": Field("text", ("I",)),
}
"""Schema of `pianomime.players.body.BodyMetrics` as JSON."""
ROW_SCHEMA: dict[str, Schema] = {
    "song": Field("text"),
    "player": Field("text"),
    "effort": _COUNT,
    "song_seconds": _SECONDS,
    "frames": _COUNT,
    "protocol": Field("text"),
    "touch": Field("text"),
    "world": Field("text"),
    "music": MUSIC_SCHEMA,
    "body": BODY_SCHEMA,
    **dict.fromkeys(("precision", "recall", "f1", "onset_f1"), _SHARE),
    "pedal_f1": Field("float", (), 0, 1, optional=True),
    **dict.fromkeys(("plan_seconds", "simulate_seconds", "realtime_factor"), _SECONDS),
    **dict.fromkeys(("notes", "dropped_notes", "blow_ups"), _COUNT),
    "remarks": Field("text", ("R",), optional=True),
}
"""Schema of a summary."""


def summarize(performance: Performance, frames: Iterable[FrameMotion] | None = None) -> Row:
    """Summarize a performance in one row.

    Args:
        performance: any performance.
        frames: its motion, as for `pianomime.players.body.body_metrics`.

    Returns:
        `song`, `player` and `effort`; `song_seconds` and `frames`; `music`, an object with
        `pianomime.music.MusicMetrics`, and `protocol`, the digest of their protocol; `touch`, the
        map that velocities were read with; `world`, the name of that in which it was played;
        `body`, an object with `pianomime.players.body.BodyMetrics`; of the paper's protocol
        `precision`, `recall` and `f1`, and `onset_f1` at its 20 Hz, 0..1, and `pedal_f1` where the
        player works the pedal; `plan_seconds`, `simulate_seconds` and `realtime_factor`, which is
        `song_seconds` divided by their sum; `notes` of the score and `dropped_notes`, those that
        the planner did not plan;
        `blow_ups`, the number of frames in which the physics became unstable; `remarks`, what was
        mended or left out when the score was read.
    """
    return {
        "song": performance.score.title,
        "player": shown(performance.player),
        "effort": performance.effort,
        "song_seconds": round(performance.song_seconds, 3),
        "frames": len(performance),
        "protocol": protocol_digest(),
        "touch": performance.touch,
        "world": performance.world,
        "music": json_of(asdict(performance.music())),
        "body": json_of(asdict(body_metrics(performance, frames))),
        **{name: round(value, 6) for name, value in performance.metrics().items()},
        "plan_seconds": round(performance.plan_seconds, 3),
        "simulate_seconds": round(performance.simulate_seconds, 3),
        "realtime_factor": round(performance.realtime_factor, 3),
        "notes": len(performance.score.key),
        "dropped_notes": performance.dropped_notes,
        "blow_ups": len(performance.blow_ups),
        "remarks": list(performance.score.remarks),
    }


def json_of(metrics: Any) -> Any:
    """Metrics as JSON holds them, to a millionth.

    Args:
        metrics: numbers, texts and None, in tuples and in dictionaries by name.
    """
    if isinstance(metrics, dict):
        return {name: json_of(value) for name, value in metrics.items()}
    if isinstance(metrics, tuple):
        return [json_of(value) for value in metrics]
    return round(metrics, 6) if isinstance(metrics, float) else metrics
