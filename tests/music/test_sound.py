"""The pianos, sampled and plain, and WAV files."""

import subprocess
import sys
import wave
from pathlib import Path

import numpy as np
import pytest

from pianomime.music import Score, render_audio, write_wav
from pianomime.music.sound import MAX_SECONDS, SAMPLE_RATE, TAIL, Sound, live_sound
from pianomime.music.wav import WavFile, write_wav_blocks

RATE = 8000


@pytest.fixture(autouse=True, params=["sampled", "plain"])
def kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Every test hears both pianos."""
    if request.param == "plain":
        monkeypatch.setitem(sys.modules, "midirenderer", None)
    else:
        pytest.importorskip("midirenderer")
    return str(request.param)


def piano(
    *notes: tuple[int, float, float, int],
    pedal: tuple[float, float] | None = None,
    rate: int = RATE,
) -> np.ndarray:
    key, onset, offset, velocity = (np.array(column) for column in zip(*notes, strict=True))
    intervals = np.array([pedal] if pedal else np.zeros((0, 2)))
    return render_audio(Score(key, onset, offset, velocity, intervals), rate)


def loudness(audio: np.ndarray, start: float, end: float) -> float:
    return float(np.sqrt((audio[round(start * RATE) : round(end * RATE)] ** 2).mean()))


@pytest.mark.parametrize("rate", [SAMPLE_RATE, 44100])
@pytest.mark.parametrize("key", [48, 27, 12, 70, 87], ids=["A4", "C3", "A1", "G6", "C8"])
def test_pitch(key: int, rate: int) -> None:
    audio = piano((key, 0.0, 2.0, 80), rate=rate)[: 2 * rate].sum(axis=1)
    spectrum = np.abs(np.fft.rfft(audio * np.hanning(len(audio))))
    pitch = 440 * 2 ** ((key - 48) / 12)
    near = slice(round(pitch * 2 * 0.6), round(pitch * 2 * 1.5))
    found = (np.argmax(spectrum[near]) + near.start) / 2
    # Within a quarter tone: pianos are tuned a little wide.
    assert found == pytest.approx(pitch, rel=0.029, abs=0.5)


def test_shape_peak_and_determinism() -> None:
    notes = [(20 + k, 0.1 * k, 0.1 * k + 2, 127) for k in range(30)]
    audio = piano(*notes)
    assert audio.dtype == np.float32
    assert audio.shape == (round((0.1 * 29 + 2 + TAIL) * RATE), 2)
    assert np.abs(audio).max() == pytest.approx(0.9, abs=1e-5)
    assert np.isfinite(audio).all()
    assert (audio == piano(*notes)).all()


def test_the_samples_are_used_where_there_are_any(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    audio = piano((40, 0, 1, 80))
    monkeypatch.setattr("pianomime.music.sound.find_spec", lambda name: None)
    without_soundfont = piano((40, 0, 1, 80))
    assert audio.shape == without_soundfont.shape
    assert audio.dtype == without_soundfont.dtype
    assert (audio == without_soundfont).all() == (kind == "plain")


def test_a_synthesizer_that_fails_does_no_harm(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(soundfont: bytes, midi: bytes) -> bytes:
        raise RuntimeError

    monkeypatch.setitem(sys.modules, "midirenderer", type("", (), {"render_wave_from": fail}))
    assert np.abs(piano((40, 0, 1, 80))).max() == pytest.approx(0.9, abs=1e-5)


def test_the_soundfonts_library_is_not_imported() -> None:
    play = "import sys; from pianomime.music import *; render_audio(Score([40], [0], [1], [80]))"
    check = "assert 'pretty_midi' not in sys.modules"
    subprocess.run([sys.executable, "-c", f"{play}; {check}"], check=True)


def test_sound_ends_when_the_key_comes_up_or_the_pedal_does() -> None:
    dry = piano((30, 0, 0.3, 80))
    pedalled = piano((30, 0, 0.3, 80), pedal=(0.1, 2.0))
    assert loudness(dry, 1.3, 1.8) < 0.02 * loudness(dry, 0, 0.3)
    assert loudness(pedalled, 1.3, 1.8) > 0.1 * loudness(pedalled, 0, 0.3)
    assert loudness(pedalled, 3, 3.5) < 0.02 * loudness(pedalled, 0, 0.3)
    assert len(pedalled) == round((2.0 + TAIL) * RATE)


@pytest.mark.parametrize("key", [0, 30, 87])
def test_the_release_is_not_cut(key: int) -> None:
    audio = piano((key, 0, 0.3, 80))
    assert np.abs(audio[-RATE // 20 :]).max() < 0.01


def test_a_pedal_that_is_never_lifted_ends_when_all_is_silent() -> None:
    audio = piano((30, 0, 0.3, 80), pedal=(0.1, 1e6))
    assert len(audio) < 15 * RATE
    assert np.abs(audio[-RATE // 20 :]).max() < 0.01


def test_pedal_pressed_after_the_key_came_up_does_nothing() -> None:
    dry = piano((30, 0, 0.3, 80), (60, 3, 3.2, 80))
    late = piano((30, 0, 0.3, 80), (60, 3, 3.2, 80), pedal=(0.5, 2.0))
    assert (dry == late).all()


def test_harder_is_louder() -> None:
    audio = piano((40, 0, 0.5, 30), (40, 1.5, 2.0, 110))
    assert loudness(audio, 1.5, 2.0) > 2 * loudness(audio, 0, 0.5)


def test_bass_is_on_the_left(kind: str) -> None:
    if kind == "sampled":
        pytest.skip("the samples are where the soundfont puts them")
    bass, treble = (np.abs(piano((key, 0, 1, 80))).sum(axis=0) for key in (0, 80))
    assert bass[0] > bass[1]
    assert treble[0] < treble[1]


@pytest.mark.parametrize("pedal", [np.zeros((0, 2)), [[0.0, 1e6]]])
def test_an_empty_score_is_silent(pedal: object) -> None:
    audio = render_audio(Score([], [], [], [], pedal), RATE)
    assert audio.shape == (round(TAIL * RATE), 2)
    assert not audio.any()


@pytest.mark.parametrize("length", [0.0, 0.1])
def test_a_multitude_of_notes(length: float) -> None:
    generator = np.random.default_rng(0)
    onset = generator.uniform(0, 1, 3000)
    score = Score(generator.integers(0, 88, 3000), onset, onset + length, np.full(3000, 127))
    assert np.abs(render_audio(score, RATE)).max() == pytest.approx(0.9, abs=1e-5)


@pytest.mark.parametrize("rate", [RATE, SAMPLE_RATE])
def test_blocks_join_without_a_seam(kind: str, rate: int, monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(1)
    onset = generator.uniform(0, 25, 60)
    # The first bass note is held over all blocks but the last.
    onset[0] = 0.5
    offset = onset + generator.uniform(0.1, 4, 60)
    offset[0] = 24.0
    key = generator.integers(10, 88, 60)
    score = Score(key, onset, offset, generator.integers(30, 127, 60), [[3.0, 9.5], [17.0, 21.0]])
    whole = render_audio(score, rate)
    monkeypatch.setattr("pianomime.music.sound.BLOCK_SECONDS", 4)
    sound, told = Sound(score, rate), []
    blocks = list(sound.blocks(told.append))
    assert len(blocks) == sound.block_count > 5
    assert max(len(block) for block in blocks) == 4 * rate
    assert sum(told) == 2 * sound.block_count
    if kind == "plain":
        np.testing.assert_array_equal(np.concatenate(blocks), whole)
    else:
        # The synthesizer rounds to 16 bits, here of a sound whose loudest sample is not full scale;
        # before every block, it knows of ten seconds.
        np.testing.assert_allclose(np.concatenate(blocks), whole, atol=3e-3)


def test_a_very_long_song_is_cut_with_a_warning() -> None:
    # Hours of silence would take the memory all the same.
    with pytest.warns(UserWarning, match="first 10 of 180 minutes"):
        audio = piano((40, 0, 1, 80), (40, MAX_SECONDS, 3 * 3600, 80))
    assert audio.shape == (round((1 + TAIL) * RATE), 2)


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


def test_wav_files_are_written_and_read_in_blocks(tmp_path: Path) -> None:
    audio = np.linspace(-1, 1, 2 * 2500, dtype=np.float32).reshape(-1, 2)
    write_wav_blocks(
        tmp_path / "song.wav", (audio[at : at + 700] for at in range(0, 2500, 700)), 2, 500
    )
    with WavFile(tmp_path / "song.wav") as file:
        assert file.shape == (2500, 2)
        assert file.sample_rate == 500
        np.testing.assert_allclose(file[100:220], audio[100:220], atol=2e-5)
        np.testing.assert_allclose(file[2490:9999], audio[2490:], atol=2e-5)
        assert file[9999:99999].shape == (0, 2)
        blocks = list(file.blocks(2.0))
        assert [len(block) for block in blocks] == [1000, 1000, 500]
        np.testing.assert_allclose(np.concatenate(blocks), audio, atol=2e-5)


def test_stretches_made_while_music_is_played_are_one_sound() -> None:
    rng = np.random.default_rng(0)
    onset = np.sort(rng.uniform(0.0, 5.0, 40))
    score = Score(
        rng.integers(20, 70, 40),
        onset,
        onset + rng.uniform(0.1, 3.0, 40),
        rng.integers(30, 120, 40),
    )
    whole = live_sound(score, 0.0, 5.0)
    parts = []
    for second in range(5):
        # Of a note that still sounds nobody knows yet how long it will.
        known = score.onset < second + 1
        offset = np.where(score.offset > second + 1, 99.0, score.offset)
        so_far = Score(score.key[known], score.onset[known], offset[known], score.velocity[known])
        parts.append(live_sound(so_far, float(second), 1.0))
    np.testing.assert_array_equal(np.vstack(parts), whole)
    assert np.abs(whole).max() > 0
