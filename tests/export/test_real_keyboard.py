"""A real keyboard's recording of an exported performance is scored like the simulation."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mido
import pytest

import made_up
from pianomime.cli import main
from pianomime.music import Score


def recorded(score: Score, begins: float) -> mido.MidiFile:
    """What a recorder makes of it: another tempo and resolution, a clock, ends by note-ons of 0."""
    times = [
        *(
            (on, mido.Message("note_on", channel=3, note=int(key) + 21, velocity=int(loud)))
            for key, on, loud in zip(score.key, score.onset, score.velocity, strict=True)
        ),
        *(
            (off, mido.Message("note_on", channel=3, note=int(key) + 21, velocity=0))
            for key, off in zip(score.key, score.offset, strict=True)
        ),
        *(
            (time, mido.Message("control_change", channel=3, control=64, value=value))
            for pair in score.pedal
            for time, value in zip(pair, (100, 10), strict=True)
        ),
    ]
    file = mido.MidiFile(type=0, ticks_per_beat=960)
    track = file.add_track()
    track.append(mido.MetaMessage("set_tempo", tempo=800_000))
    ticks = 0
    for time, message in sorted(times, key=lambda item: (item[0], getattr(item[1], "velocity", 0))):
        now = round((begins + float(time)) * 960 / 0.8)
        track.append(message.copy(time=now - ticks))
        ticks = now
    return file


def scored(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    main(["score", *arguments, "--json"])
    return json.loads(capsys.readouterr().out)["music"]


def test_a_recording_counts_from_when_it_was_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    performance = made_up.performance(made_up.score())
    performance.score.to_midi("song.mid")
    performance.played().to_midi("performance.mid")
    # The recorder ran for 3.25 s before the hands moved, and the keyboard sends 20 ms late.
    recorded(performance.played(), 3.25 + 0.02).save("recorded.mid")
    simulated = scored(capsys, "performance.mid", "--against", "song.mid")
    real = scored(capsys, "recorded.mid", "--against", "song.mid", "--lead-in", "3.25")
    lag = real["onset_error_ms"][1] - simulated["onset_error_ms"][1]
    assert lag == pytest.approx(20, abs=1.5)
    without = scored(
        capsys, "recorded.mid", "--against", "song.mid", "--lead-in", str(3.25 + lag / 1000)
    )
    for name in ("notes", "strikes", "velocity_correlation", "note_f1_50", "note_f1_25"):
        assert without[name] == pytest.approx(simulated[name], abs=1e-3), name
    assert scored(capsys, "recorded.mid", "--against", "song.mid")["note_f1_50"] < 0.3
