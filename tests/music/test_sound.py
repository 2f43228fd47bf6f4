"""The synthetic piano and WAV files."""

import wave
from pathlib import Path

import numpy as np
import pytest

from pianomime.music import Score, render_audio, write_wav

RATE = 8000


def piano(
    *notes: tuple[int, float, float, int], pedal: tuple[float, float] | None = None
) -> np.ndarray:
    key, onset, offset, velocity = (np.array(column) for column in zip(*notes, strict=True))
    intervals = np.array([pedal] if pedal else np.zeros((0, 2)))
    return render_audio(Score(key, onset, offset, velocity, intervals), RATE)


def loudness(audio: np.ndarray, start: float, end: float) -> float:
    return float(np.sqrt((audio[round(start * RATE) : round(end * RATE)] ** 2).mean()))


@pytest.mark.parametrize("key", [0, 27, 48, 70, 87])
def test_pitch(key: int) -> None:
    rate = 44100
    audio = render_audio(Score([key], [0.0], [2.0], [80]), rate)[: 2 * rate].sum(axis=1)
    spectrum = np.abs(np.fft.rfft(audio * np.hanning(len(audio))))
    pitch = 440 * 2 ** ((key - 48) / 12)
    near = slice(round(pitch * 2 * 0.75), round(pitch * 2 * 1.25))
    found = (np.argmax(spectrum[near]) + near.start) / 2
    # Stiff strings sound a little sharp, within a quarter tone.
    assert found == pytest.approx(pitch, rel=0.029, abs=0.5)


def test_shape_peak_and_determinism() -> None:
    notes = [(20 + k, 0.1 * k, 0.1 * k + 2, 127) for k in range(30)]
    audio = piano(*notes)
    assert audio.dtype == np.float32
    assert audio.shape == (round((0.1 * 29 + 2 + 1) * RATE), 2)
    assert np.abs(audio).max() == pytest.approx(0.9, abs=1e-5)
    assert np.isfinite(audio).all()
    assert (audio == piano(*notes)).all()


def test_sound_ends_when_the_key_comes_up_or_the_pedal_does() -> None:
    # The second note keeps the scale the same.
    dry = piano((30, 0, 0.3, 80), (60, 3, 3.2, 80))
    pedalled = piano((30, 0, 0.3, 80), (60, 3, 3.2, 80), pedal=(0.1, 2.0))
    assert loudness(dry, 1, 1.8) < 0.02 * loudness(dry, 0, 0.3)
    assert loudness(pedalled, 1, 1.8) > 0.1 * loudness(pedalled, 0, 0.3)
    assert loudness(pedalled, 2.6, 2.9) < 0.02 * loudness(pedalled, 0, 0.3)


def test_pedal_pressed_after_the_key_came_up_does_nothing() -> None:
    dry = piano((30, 0, 0.3, 80), (60, 3, 3.2, 80))
    late = piano((30, 0, 0.3, 80), (60, 3, 3.2, 80), pedal=(0.5, 2.0))
    assert (dry == late).all()


def test_striking_again_stops_the_old_sound() -> None:
    once = piano((30, 0, 0.3, 80), (30, 1.0, 1.3, 80), pedal=(0, 3))
    assert loudness(once, 1.0, 1.2) < 1.3 * loudness(once, 0, 0.2)


def test_harder_is_louder() -> None:
    audio = piano((40, 0, 0.5, 30), (40, 1.5, 2.0, 110))
    assert loudness(audio, 1.5, 2.0) > 2 * loudness(audio, 0, 0.5)


def test_bass_is_on_the_left() -> None:
    bass, treble = piano((0, 0, 1, 80)), piano((80, 0, 1, 80))
    assert np.abs(bass[:, 0]).sum() > np.abs(bass[:, 1]).sum()
    assert np.abs(treble[:, 0]).sum() < np.abs(treble[:, 1]).sum()


def test_an_empty_score_is_silent() -> None:
    audio = render_audio(Score([], [], [], []), RATE)
    assert audio.shape == (RATE, 2)
    assert not audio.any()


def test_wav_file(tmp_path: Path) -> None:
    audio = np.array([[0.0, 0.5], [-1.0, 1.0], [2.0, -2.0]], np.float32)
    write_wav(tmp_path / "song.wav", audio, 22050)
    with wave.open(str(tmp_path / "song.wav")) as file:
        assert (file.getnchannels(), file.getsampwidth(), file.getframerate()) == (2, 2, 22050)
        samples = np.frombuffer(file.readframes(9), "<i2").reshape(-1, 2)
    assert samples.tolist() == [[0, 16384], [-32767, 32767], [32767, -32767]]
    assert [file.name for file in tmp_path.iterdir()] == ["song.wav"]
    with pytest.raises(ValueError, match=r"\(S, C\)"):
        write_wav(tmp_path / "song.wav", audio[:, 0])
