"""Measures with their names for readers, as tables, pages and terminals show them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pianomime.evaluation.summary import Row

_NOTHING = "-"
"""Stands for what could not be measured."""


@dataclass(frozen=True)
class Measure:
    """A value of a row, or of the mean of rows, for readers.

    Attributes:
        label: what it is, with its unit.
        name: in the row, with a dot in front of each name in an object.
        form: how its numbers are written.
    """

    label: str
    name: str
    form: str = "{:.3f}"

    def show(self, row: Row) -> str:
        """The value.

        Args:
            row: of `pianomime.evaluation.summary.summarize`, or a mean of rows.

        Returns:
            Its numbers with commas between them; "-" where there was nothing to measure.
        """
        value: Any = row
        for name in self.name.split("."):
            value = value[name]
        if value is None:
            return _NOTHING
        return ", ".join(map(self.form.format, value if isinstance(value, list) else [value]))


MUSIC = (
    Measure("note F1, 50 ms", "music.note_f1_50"),
    Measure("note F1, 25 ms", "music.note_f1_25"),
    Measure("note F1, 10 ms", "music.note_f1_10"),
    Measure("note F1, 50 ms and offsets", "music.note_offset_f1_50"),
    Measure("velocity F1", "music.velocity_f1"),
    Measure("phantom notes a minute", "music.phantoms_per_minute", "{:.1f}"),
    Measure("repeated notes struck again", "music.restruck"),
    Measure("chord spread, p90 [ms]", "music.chord_spread_p90_ms", "{:.0f}"),
    Measure("onset error, p5, p50, p95 [ms]", "music.onset_error_ms", "{:+.0f}"),
)
"""What an ear would judge, by the `music` protocol."""

MORE_MUSIC = (
    Measure("offset error, p5, p50, p95 [ms]", "music.offset_error_ms", "{:+.0f}"),
    Measure("velocity F1, rescaled", "music.velocity_f1_rescaled"),
    Measure("correlation of velocities", "music.velocity_correlation"),
    Measure("chord spread, p50 [ms]", "music.chord_spread_p50_ms", "{:.0f}"),
    Measure("chord spread in the score, p90 [ms]", "music.chord_spread_wanted_p90_ms", "{:.0f}"),
    Measure("pedal lifts kept", "music.pedal_lifts_kept"),
    Measure("F1 of the time that keys are down", "music.key_time_f1"),
    Measure("never struck: melody", "music.melody.share", "{:.1%}"),
    Measure("never struck: bass", "music.bass.share", "{:.1%}"),
    Measure("never struck: inner voices", "music.inner.share", "{:.1%}"),
)
"""The rest of it that readers want of one song."""

FRAMES = (
    Measure("frame F1", "f1"),
    Measure("frame precision", "precision"),
    Measure("frame recall", "recall"),
)
"""The protocol of the paper: the keys that are down in each frame of 0.05 s."""

BODY = (
    Measure("hands overlap", "body.hands_overlap", "{:.1%}"),
    Measure("fingers overlap", "body.fingers_overlap", "{:.1%}"),
    Measure("forearms crossed", "body.forearms_crossed", "{:.1%}"),
    Measure("a joint over 10 rad/s", "body.joints_fast", "{:.1%}"),
    Measure("fastest rail [m/s]", "body.rail_speed_max", "{:.2f}"),
    Measure("strongest rail [N]", "body.rail_force_max", "{:.0f}"),
)
"""Whether hands could move so."""
