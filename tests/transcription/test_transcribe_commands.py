"""`pianomime transcribe`, and `pianomime play` of recordings, with a listener who is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from made_up_listener import Teller, tone
from one_line import fails
from pianomime.cli import main
from pianomime.music import Score
from pianomime.transcription import listener

SAID = Score(
    np.array([39, 43, 46, 51, 46, 43]),
    np.arange(6) * 0.5,
    np.arange(6) * 0.5 + 0.4,
    np.array([50, 60, 70, 80, 90, 100]),
    np.array([[0.2, 1.4]]),
)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The network's part is played by one who knows."""
    monkeypatch.setattr(listener, "can_listen", lambda: True)
    monkeypatch.setattr("pianomime.transcription.transcribe.find_listener", lambda: Teller(SAID))


@pytest.mark.usefixtures("told")
def test_a_recording_becomes_a_midi_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["transcribe", str(tone(tmp_path / "a song.wav")), "-o", "deep/er/song.mid"])
    read = Score.from_midi("deep/er/song.mid")
    np.testing.assert_array_equal(read.key, SAID.key)
    np.testing.assert_array_equal(read.velocity, SAID.velocity)
    np.testing.assert_allclose(read.onset, SAID.onset, atol=1e-3)
    np.testing.assert_allclose(read.pedal, SAID.pedal, atol=1e-3)
    assert capsys.readouterr().out.splitlines() == [
        "heard 6 notes in 2.9 s, and the pedal 1 times",
        "transcription: deep/er/song.mid",
        "next: pianomime play deep/er/song.mid",
    ]


@pytest.mark.usefixtures("told")
def test_where_it_goes_by_default(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["transcribe", str(tone(tmp_path / "song.wav", 60.0))])
    assert Path("out/song.mid").is_file()
    assert "note: hardly any notes are heard: 6 in 60 s" in capsys.readouterr().out


@pytest.mark.usefixtures("told")
def test_what_is_no_recording_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    silent = str(tone(tmp_path / "silent.wav", loud=0.0))
    sounding = str(tone(tmp_path / "song.wav"))
    Path("bad.mp3").write_bytes(b"\x01 something else")
    Path("folder.mid").mkdir()
    Path("file").touch()
    for arguments, why in (
        (["nothing.wav"], "nothing.wav: does not exist"),
        (["bad.mp3"], "bad.mp3: not sound or a video that can be read"),
        (["folder.mid"], "is a folder"),
        ([silent], "silent.wav: is silent"),
        ([sounding, "-o", "song.wav"], "must end in .mid"),
        ([sounding, "-o", "folder.mid"], "is a folder"),
        ([sounding, "-o", "file/song.mid"], "a folder is needed"),
    ):
        assert why in fails(["transcribe", *arguments], capsys)
    assert not Path("out").exists()


def test_the_extra_is_missed_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listener, "find_spec", lambda _: None)
    path = str(tone(tmp_path / "song.wav"))
    for command in ("transcribe", "play"):
        assert "[audio]" in fails([command, path], capsys)
    assert not Path("out").exists()


@pytest.mark.usefixtures("told")
def test_a_recording_is_played(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tone(tmp_path / "song.WAV")
    main(["play", str(path), "--seconds", "1", "--effort", "0", "--player", "zero-shot-20hz"])
    assert Path("out/song/report.html").is_file()
    assert len(Score.from_midi("out/song/song-transcribed.mid")) == len(SAID)
    assert "transcription: out/song/song-transcribed.mid" in capsys.readouterr().out


@pytest.mark.usefixtures("told")
def test_who_cannot_play_it_is_told_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(tone(tmp_path / "song.wav"))
    assert "plays demonstrations" in fails(["play", path, "--player", "demonstration"], capsys)
    assert "no player" in fails(["play", path, "--player", "nobody"], capsys)
    assert not Path("out").exists()
