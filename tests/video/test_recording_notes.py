"""Notes of recordings: of the sound, of keys that light up, and of both; a listener is told."""

from __future__ import annotations

import json
import re
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

import made_up_video as made_up
from made_up_listener import Teller, tone
from one_line import fails
from pianomime.cli import main
from pianomime.commands.keyboard import FindKeyboard
from pianomime.commands.retarget import Retarget
from pianomime.commands.transcribe import Transcribe
from pianomime.errors import InputError
from pianomime.music import Score, onset_f1
from pianomime.transcription import listener as listening
from pianomime.video.advice import KEYBOARD, RETARGET, TRANSCRIBE, Advice
from pianomime.video.keyboard.plane import Plane
from pianomime.video.keyboard.points import place_of
from pianomime.video.recording_notes import RecordingConfig, RecordingNotes, notes_of_recording

SIZE = (640, 360)
SECONDS = 5.0
RATE = 44_100


@pytest.fixture(scope="module")
def score() -> Score:
    song = made_up.song(SECONDS)
    return replace(song, velocity=np.arange(len(song)) % 90 + 20, pedal=np.array([[1.0, 2.0]]))


def write(
    path: Path,
    score: Score,
    lit: bool = True,
    sound: float | None = SECONDS,
    plane: Plane | None = None,
) -> Path:
    """A film of a keyboard without hands, with so many seconds of a tone."""
    plane = plane or made_up.camera(SIZE)
    with av.open(str(path), "w") as film:
        stream: Any = film.add_stream("libx264", rate=20)
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        voice: Any = None if sound is None else film.add_stream("aac", rate=RATE, layout="mono")
        for number in range(round(20 * SECONDS)):
            at = number / 20
            keys = score.key[(score.onset <= at) & (at < score.offset)] if lit else ()
            frame = av.VideoFrame.from_ndarray(made_up.picture(plane, SIZE, keys), format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, 20)
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
        if sound is not None:
            times = np.arange(round(sound * RATE)) / RATE
            wave = (0.3 * np.sin(2 * np.pi * 440 * times)).astype(np.float32)
            piece = av.AudioFrame.from_ndarray(wave[None], format="fltp", layout="mono")
            piece.sample_rate, piece.pts = RATE, 0
            film.mux(voice.encode(piece))
            film.mux(voice.encode(None))
    return path


@pytest.fixture(scope="module")
def lit(tmp_path_factory: pytest.TempPathFactory, score: Score) -> Path:
    return write(tmp_path_factory.mktemp("lit") / "falling.mp4", score)


@pytest.fixture(scope="module")
def unlit(tmp_path_factory: pytest.TempPathFactory, score: Score) -> Path:
    return write(tmp_path_factory.mktemp("unlit") / "unlit.mp4", score, lit=False)


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> RecordingConfig:
    """Where the keyboard is, which it takes seconds to find."""
    plane, path = made_up.camera(SIZE), tmp_path_factory.mktemp("points") / "points.json"
    names = ("C2 front left", "C2 back left", "C6 front left", "C6 back left")
    places = {name: plane.to_pixels(place_of(name)).tolist() for name in names}
    path.write_text(json.dumps({"points": places}))
    return RecordingConfig(points=path)


@pytest.fixture
def deaf(monkeypatch: pytest.MonkeyPatch) -> None:
    """The extra `audio` is not installed."""
    monkeypatch.setattr(listening, "find_spec", lambda _: None)


def right(read: RecordingNotes, score: Score, tolerance: float = 0.1) -> bool:
    of_score, of_read = ((each.key, each.onset) for each in (score, read.score))
    return onset_f1(of_score, of_read, tolerance) > 0.97


def test_light_and_sound(lit: Path, score: Score, known: RecordingConfig) -> None:
    """Ghosts that are heard are not in the light; touch and pedal are not, either."""
    heard = replace(
        score,
        key=np.append(score.key, score.key[:5] + 36),
        onset=np.append(score.onset, score.onset[:5]),
        offset=np.append(score.offset, score.offset[:5]),
        velocity=np.append(score.velocity, score.velocity[:5]),
    )
    read = notes_of_recording(lit, known, listener=Teller(heard))
    assert read.source == "light and sound"
    assert right(read, score, 0.05)
    assert read.score.key.max() == score.key.max()
    assert len(np.unique(read.score.velocity)) > 10
    np.testing.assert_allclose(read.score.pedal, score.pedal, atol=0.05)
    assert "5 only heard are left out" in read.score.remarks[0]


@pytest.mark.usefixtures("deaf")
def test_light_where_nobody_can_listen(lit: Path, score: Score, known: RecordingConfig) -> None:
    read = notes_of_recording(lit, known)
    assert read.source == "light"
    assert right(read, score)
    assert "[audio]" in read.score.remarks[0]
    with pytest.raises(InputError, match=r"\[audio\]"):
        notes_of_recording(lit, RecordingConfig(notes="sound"))


@pytest.mark.parametrize("why", ["has no sound", "no notes of a piano"])
def test_light_where_the_sound_has_no_notes(
    lit: Path, score: Score, known: RecordingConfig, tmp_path: Path, why: str
) -> None:
    nothing = Score(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0))
    film = write(tmp_path / "film.mp4", score, sound=None) if why == "has no sound" else lit
    read = notes_of_recording(film, known, listener=Teller(nothing))
    assert read.source == "light"
    assert right(read, score)
    assert why in read.score.remarks[0]


def test_light_alone_is_asked_for(lit: Path, score: Score, known: RecordingConfig) -> None:
    class Nobody(Teller):
        def hear(self, samples: Any, heard: Any) -> Score:
            pytest.fail("listened")

    read = notes_of_recording(lit, replace(known, notes="light"), listener=Nobody(score))
    assert read.source == "light"
    assert read.score.remarks == ()


def test_the_sound_of_a_film_whose_keys_do_not_light_up(
    unlit: Path, score: Score, known: RecordingConfig
) -> None:
    read = notes_of_recording(unlit, known, listener=Teller(score))
    assert read.source == "sound"
    np.testing.assert_array_equal(read.score.onset, score.onset)


def test_light_and_sound_that_disagree(lit: Path, score: Score, known: RecordingConfig) -> None:
    """What is not in doubt is taken, and that there is another is said."""
    other = score.transpose(23)
    read = notes_of_recording(lit, known, listener=Teller(other))
    assert read.source == "sound"
    assert "keys seem to light up as well" in read.score.remarks[0]
    # A few notes in a loud film are in doubt.
    few = Score(other.key[:2], other.onset[:2], other.offset[:2], other.velocity[:2])
    read = notes_of_recording(lit, known, listener=Teller(few))
    assert read.source == "light"
    assert right(read, score)
    assert any("the sound is of no help" in remark for remark in read.score.remarks)


def test_a_very_short_sound(score: Score, tmp_path: Path, known: RecordingConfig) -> None:
    film = write(tmp_path / "short.mp4", score, sound=0.2)
    read = notes_of_recording(film, known, listener=Teller(score))
    assert read.source == "light"
    assert right(read, score)


def test_a_damaged_sound(score: Score, tmp_path: Path, known: RecordingConfig) -> None:
    """What can be read of it is heard; its end is missed, not made up."""
    film = write(tmp_path / "film.mp4", score, lit=False)
    with av.open(str(film)) as old, av.open(str(tmp_path / "damaged.mp4"), "w") as new:
        streams = {each: new.add_stream_from_template(each) for each in old.streams}
        for packet in old.demux():
            if packet.dts is None:
                continue
            late = packet.stream.type == "audio" and packet.pts * packet.time_base > 2.5
            copy = av.Packet(b"\xff" * packet.size) if late else packet
            copy.pts, copy.dts, copy.time_base = packet.pts, packet.dts, packet.time_base
            copy.stream = streams[packet.stream]
            new.mux(copy)
    with pytest.warns(UserWarning, match="its sound cannot be read to its end"):
        read = notes_of_recording(tmp_path / "damaged.mp4", known, listener=Teller(score))
    assert 0 < len(read.score) < len(score)
    assert read.score.onset.max() < 2.7


def test_the_sound_decides_an_open_octave(score: Score, tmp_path: Path) -> None:
    """What is seen is taken for keys in the middle, and is an octave lower."""
    film = write(tmp_path / "part.mp4", score, plane=made_up.camera(SIZE, span=(-0.55, 0.15)))
    read = notes_of_recording(film, listener=Teller(score))
    assert read.source == "light and sound"
    assert right(read, score)
    assert not any("octave" in remark for remark in read.score.remarks)
    nobody = notes_of_recording(film, RecordingConfig(notes="light"))
    assert not right(nobody, score)
    assert "leaves the octave open" in nobody.score.remarks[0]


@pytest.mark.parametrize(
    ("advice", "command"),
    [(RETARGET, Retarget), (TRANSCRIBE, Transcribe), (KEYBOARD, FindKeyboard)],
)
def test_advice_is_of_options_that_there_are(advice: Advice, command: type) -> None:
    options = {f"--{each.name.replace('_', '-')}" for each in fields(command)}
    said = [getattr(advice, each.name) for each in fields(advice)]
    assert set(re.findall(r"--[a-z-]+", " ".join(said))) <= options


@pytest.mark.usefixtures("deaf")
def test_no_notes_at_all_are_one_line(
    unlit: Path,
    score: Score,
    known: RecordingConfig,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    silent = write(tmp_path / "silent.mp4", score, lit=False, sound=None)
    out = ["-o", str(tmp_path / "out" / "song.mid"), "--points", str(known.points)]
    said = fails(["transcribe", str(silent), *out], capsys)
    assert "of its sound: has no sound; of its pictures: keys do not light up" in said
    assert "[audio]" in fails(["transcribe", str(unlit), *out], capsys)
    assert "keys do not light up" in fails(
        ["transcribe", str(unlit), "--notes", "light", *out], capsys
    )
    assert "has no sound" in fails(["transcribe", str(silent), "--notes", "sound", *out], capsys)
    wave = str(tone(tmp_path / "song.wav"))
    assert "has no pictures" in fails(["transcribe", wave, "--notes", "light", *out], capsys)
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("deaf")
def test_falling_notes_become_a_midi_file_and_are_played(
    lit: Path,
    score: Score,
    known: RecordingConfig,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    main(["transcribe", str(lit), "--points", str(known.points), "-o", "song.mid"])
    read = Score.from_midi("song.mid")
    assert onset_f1((score.key, score.onset), (read.key, read.onset), 0.1) > 0.97
    assert capsys.readouterr().out.startswith(f"saw {len(read)} notes in ")
    play = ["--seconds", "1", "--effort", "0", "--player", "zero-shot-20hz"]
    main(["play", str(lit), *play])
    assert Path("out/falling/report.html").is_file()
    played = Score.from_midi("out/falling/falling-transcribed.mid")
    np.testing.assert_array_equal(played.key, read.key)


def test_a_picture_in_a_picture(score: Score, tmp_path: Path) -> None:
    """A film in the corner of another one, large enough for keys to be told apart."""
    size, inner = (1280, 720), (960, 540)
    plane, first = made_up.camera(inner), score.clip(0.0, 2.5)
    room = np.add.outer(np.linspace(40, 140, size[1]), np.linspace(0, 60, size[0]))
    around = np.repeat(room[..., None], 3, axis=2).astype(np.uint8)
    path = tmp_path / "corner.mp4"
    with av.open(str(path), "w") as film:
        stream: Any = film.add_stream("libx264", rate=20)
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        for number in range(50):
            at = number / 20
            keys = first.key[(first.onset <= at) & (at < first.offset)]
            seen = around.copy()
            seen[-580:-40, -1000:-40] = made_up.picture(plane, inner, keys)
            frame = av.VideoFrame.from_ndarray(seen, format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, 20)
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
    assert right(notes_of_recording(path, RecordingConfig(notes="light")), first)
