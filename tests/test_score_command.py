"""`pianomime score`: anybody's playing is scored by the music protocol."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import made_up
from pianomime.cli import main
from pianomime.evaluation.summary import summarize
from pianomime.music import Score, excerpt


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as stopped:
        main(["score", *arguments])
    assert stopped.value.code == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    return line


def scored(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    main(["score", *arguments, "--json"])
    row = json.loads(capsys.readouterr().out)
    assert set(row) == {"song", "protocol", "music"}
    return row


def song(begins: float = 0.0) -> Score:
    """A scale of 40 s."""
    onset = begins + np.arange(80) * 0.5
    return Score(20 + np.arange(80) % 50, onset, onset + 0.4, np.full(80, 70), title="song")


def test_a_performance_is_scored_as_in_its_report(capsys: pytest.CaptureFixture[str]) -> None:
    performance = made_up.performance(made_up.score())
    performance.save("performance.npz")
    row, report = scored(["performance.npz"], capsys), summarize(performance)
    assert row == {name: report[name] for name in ("song", "protocol", "music")}
    # Its score is what its song is, as far as MIDI files hold times.
    performance.score.to_midi("song.mid")
    again = scored(["performance.npz", "--against", "song.mid"], capsys)
    assert again["music"]["note_f1_50"] == pytest.approx(row["music"]["note_f1_50"], abs=1e-6)


def test_a_midi_file_is_scored_against_its_song(capsys: pytest.CaptureFixture[str]) -> None:
    song().to_midi("song.mid")
    late = replace(song(), onset=song().onset + 0.03, offset=song().offset + 0.03)
    late.to_midi("played.mid")
    row = scored(["played.mid", "--against", "song.mid"], capsys)
    assert row["song"] == "song"
    music = row["music"]
    assert music["notes"] == 60  # the first 30 s
    assert (music["note_f1_50"], music["note_f1_25"]) == (1.0, 0.0)
    assert music["onset_error_ms"] == pytest.approx([30, 30, 30], abs=0.1)
    every = scored(["played.mid", "--against", "song.mid", "--seconds", "inf"], capsys)
    assert every["music"]["notes"] == 80
    part = ["--start", "10.2", "--seconds", "5", "--against", "song.mid"]
    # The note that sounds at 10.2 s is the first: what was played begins with it.
    song().clip(10.2, 15.2).to_midi("part.mid")
    assert scored(["part.mid", *part], capsys)["music"]["note_f1_10"] == 1.0
    assert scored(["played.mid", *part], capsys)["music"]["note_f1_10"] < 0.1


def test_silence_before_the_song_is_no_part_of_a_playing_unless_it_is_said_so(
    capsys: pytest.CaptureFixture[str],
) -> None:
    song(begins=2.0).to_midi("song.mid")
    song(begins=2.0).to_midi("same.mid")
    song().to_midi("trimmed.mid")

    def f1(*arguments: str) -> float:
        return scored([*arguments, "--against", "song.mid"], capsys)["music"]["note_f1_50"]

    assert f1("trimmed.mid") == f1("same.mid", "--no-trim") == 1.0
    assert f1("trimmed.mid", "--no-trim") == f1("same.mid") == 0.0
    assert f1("same.mid", "--no-trim", "--start", "5", "--seconds", "10") == 1.0


def test_a_lead_in_is_silence_that_is_due(capsys: pytest.CaptureFixture[str]) -> None:
    song(begins=2.0).to_midi("song.mid")
    song(begins=0.5).to_midi("played.mid")

    def music(*arguments: str) -> Any:
        return scored([*arguments, "--against", "song.mid"], capsys)["music"]

    assert music("played.mid")["note_f1_50"] == 0.0
    due = music("played.mid", "--lead-in", "0.5")
    assert due["note_f1_10"] == 1.0
    # The last note of 30 s is there, too.
    assert due["notes"] == due["strikes"] == 60
    # A performance says itself when it was due.
    score = excerpt(Score.from_midi("song.mid"), seconds=8.0, lead_in=0.5)
    made_up.performance(score, mistakes=0.0).save("performance.npz")
    assert music("performance.npz", "--seconds", "8")["note_f1_10"] == 1.0
    assert music("performance.npz", "--seconds", "8", "--lead-in", "0")["note_f1_50"] == 0.0


def test_the_table_names_every_measure_with_its_unit(capsys: pytest.CaptureFixture[str]) -> None:
    song().to_midi("[red]song.mid")
    main(["score", "[red]song.mid", "--against", "[red]song.mid"])
    table = capsys.readouterr().out
    assert "[red]song" in table
    lines = [[cell.strip() for cell in line.split("│")] for line in table.splitlines()]
    cells = {line[1]: line[2] for line in lines if len(line) == 4}
    assert cells["note F1, 50 ms"] == "1.000"
    assert cells["phantom notes a minute"] == "0.0"
    assert cells["repeated notes struck again"] == cells["pedal lifts kept"] == "-"
    assert cells["onset error, p5, p50, p95 [ms]"] == "+0, +0, +0"


def test_what_cannot_be_scored_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    song().to_midi("song.mid")
    made_up.performance(made_up.score(5)).save("performance.npz")
    Path("text.mid").write_text("no music")
    Path("text.npz").write_text("no arrays")
    against = ["--against", "song.mid"]
    assert "--against" in fails(["song.mid"], capsys)
    assert "text.mid is not a MIDI file" in fails(["text.mid", *against], capsys)
    assert "not a performance" in fails(["text.npz", *against], capsys)
    assert "none.mid" in fails(["none.mid", *against], capsys)
    assert "no-such-song" in fails(["song.mid", "--against", "no-such-song"], capsys)
    assert "--start is a part of a song" in fails(["performance.npz", "--start", "1"], capsys)
    assert "--trim" in fails(["performance.npz", "--no-trim"], capsys)
    assert "--lead-in is a part" in fails(["performance.npz", "--lead-in", "0.5"], capsys)
    given = ["song.mid", *against, "--lead-in"]
    assert "time runs alike" in fails([*given, "0.5", "--no-trim"], capsys)
    for bad in ("-1", "nan", "inf"):
        assert "lead-in must be 0 to" in fails([*given, bad], capsys)
    for bad in ("-1", "nan", "0"):
        assert fails(["song.mid", *against, "--seconds", bad], capsys)
        assert fails(["song.mid", *against, "--no-trim", "--seconds", bad], capsys)
    assert fails(["song.mid", *against, "--start", "100"], capsys)


@pytest.mark.parametrize("more", [[], ["--no-trim"]])
def test_playing_nothing_in_time_is_no_error(
    more: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    song().to_midi("song.mid")
    song(60.0).to_midi("played.mid")
    row = scored(["played.mid", "--against", "song.mid", *more], capsys)
    assert (row["music"]["strikes"], row["music"]["note_f1_50"]) == (0, 0.0)
