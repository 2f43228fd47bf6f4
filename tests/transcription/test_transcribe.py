"""From recordings to scores: what a listener says is put together, checked and doubted."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from made_up_listener import RATE, Teller, ramp, tone
from pianomime import songs
from pianomime.errors import InputError
from pianomime.music import Score, excerpt, music_metrics, render_audio, write_wav
from pianomime.transcription.listener import can_listen, check_listener
from pianomime.transcription.loudness import PARTS, Loudness, loudness_of
from pianomime.transcription.recording import Recording
from pianomime.transcription.transcribe import transcribe, transcribe_excerpt

LONG = 1500.0
"""[s] Of three stretches."""


def some_notes(seconds: float, seed: int = 0) -> Score:
    """Notes and pedal all over a recording, some longer than what stretches share."""
    draw = np.random.default_rng(seed)
    onset = np.sort(draw.uniform(0, seconds - 1, round(3 * seconds)))
    down = np.arange(2.0, seconds - 2, 3.0)
    return Score(
        draw.integers(0, 88, len(onset)),
        onset,
        onset + draw.uniform(0.1, 15, len(onset)),
        draw.integers(1, 128, len(onset)),
        np.column_stack((down, down + draw.uniform(0.2, 2.8, len(down)))),
    )


def test_what_is_heard_in_stretches_is_the_whole(tmp_path: Path) -> None:
    said = some_notes(LONG)
    # Of two strikes of a key at once the second is taken for an echo of the first.
    order = np.lexsort((said.onset, said.key))
    near = np.flatnonzero((np.diff(said.key[order]) == 0) & (np.diff(said.onset[order]) < 0.1))
    kept = np.setdiff1d(np.arange(len(said)), order[near + 1])
    said = Score(
        said.key[kept], said.onset[kept], said.offset[kept], said.velocity[kept], said.pedal
    )
    listener = Teller(said, ramp=True)
    heard = transcribe(Recording.of(ramp(tmp_path / "a song.wav", LONG)), listener)
    assert heard.title == "a song"
    # The ramp is as loud at the end of notes as at their beginning.
    assert [doubt[:27] for doubt in heard.remarks] == ["notes that are held stay as"]
    assert listener.lengths == [616.0, 632.0, 316.0]
    for name in ("key", "velocity"):
        np.testing.assert_array_equal(getattr(heard, name), getattr(said, name))
    for name in ("onset", "offset", "pedal"):
        np.testing.assert_allclose(getattr(heard, name), getattr(said, name), atol=1e-6)


def test_a_note_that_two_stretches_claim_is_heard_once(tmp_path: Path) -> None:
    class Unsure(Teller):
        def hear(self, samples, heard):  # type: ignore[no-untyped-def]
            score = super().hear(samples, heard)
            # A little later in a stretch that does not begin with the recording.
            late = 0.0 if len(self.lengths) == 1 else 0.012
            return replace(score, onset=score.onset + late, offset=score.offset + late)

    onset = np.array([10.0, 599.995, 1000.0])
    said = Score(np.array([40, 40, 40]), onset, onset + 0.5, np.array([70, 71, 72]))
    heard = transcribe(Recording.of(ramp(tmp_path / "song.wav", LONG)), Unsure(said, ramp=True))
    assert heard.velocity.tolist() == [70, 71, 72]


def test_progress_ends_with_the_recording(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    transcribe(
        Recording.of(ramp(tmp_path / "song.wav", LONG)),
        Teller(some_notes(LONG), ramp=True),
        lambda phase, done, total, remark="": told.append((phase, done, total)),
    )
    assert {phase for phase, _, _ in told} == {"listening"}
    assert {total for _, _, total in told} == {round(LONG)}
    done = [done for _, done, _ in told]
    assert done[0] == 0
    assert done[-1] == round(LONG)


@pytest.mark.parametrize("loud", [0.0, 1e-4])
def test_silence_has_no_notes(tmp_path: Path, loud: float) -> None:
    path = tone(tmp_path / "song.wav", loud=loud)
    with pytest.raises(InputError, match=r"song\.wav: is silent"):
        transcribe(Recording.of(path), Teller(some_notes(3.0)))


def test_no_notes_are_an_error(tmp_path: Path) -> None:
    nothing = Score(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0))
    with pytest.raises(InputError, match="no notes of a piano"):
        transcribe(Recording.of(tone(tmp_path / "song.wav")), Teller(nothing))


def test_hardly_any_notes_are_doubtful(tmp_path: Path) -> None:
    few = Score(np.array([40]), np.array([0.0]), np.array([1.0]), np.array([70]))
    heard = transcribe(Recording.of(tone(tmp_path / "song.wav", 10.0)), Teller(few))
    assert len(heard) == 1
    assert [doubt.partition(":")[0] for doubt in heard.remarks] == [
        "hardly any notes are heard",
        "in 80% of the loud time no note is heard",
    ]


def wave(path: Path, loud: NDArray[np.float64]) -> Path:
    """A WAV file as loud as this, sample by sample."""
    write_wav(path, loud[:, None] * np.sign(np.sin(np.arange(len(loud))))[:, None], RATE)
    return path


def held(seconds: float) -> Score:
    """A note every two seconds."""
    onset = np.arange(0.0, seconds, 2.0)
    return Score(np.full(len(onset), 40), onset, onset + 1.9, np.full(len(onset), 70))


def test_an_instrument_whose_notes_do_not_fade_is_doubtful(tmp_path: Path) -> None:
    times = np.arange(20 * RATE) / RATE
    organ = wave(tmp_path / "organ.wav", np.full(len(times), 0.3))
    (doubt,) = transcribe(Recording.of(organ), Teller(held(20))).remarks
    assert "is it a piano?" in doubt
    piano = wave(tmp_path / "piano.wav", 0.3 * np.exp(-(times % 2.0)))
    assert transcribe(Recording.of(piano), Teller(held(20))).remarks == ()


@pytest.mark.parametrize(("notes", "doubted"), [(10, False), (11, True)])
def test_more_notes_at_once_than_fingers_are_doubtful(
    tmp_path: Path, notes: int, doubted: bool
) -> None:
    onset = np.repeat(np.arange(0.0, 10.0, 0.5), notes)
    chords = Score(
        np.tile(np.arange(notes) * 3 + 20, 20), onset, onset + 0.4, np.full(len(onset), 70)
    )
    heard = transcribe(Recording.of(tone(tmp_path / "song.wav", 10.0)), Teller(chords))
    assert any("11 notes begin at once" in doubt for doubt in heard.remarks) == doubted


def test_speech_and_noise_are_doubtful(tmp_path: Path) -> None:
    """Of what is loud nearly all the time, a few notes explain little."""
    draw = np.random.default_rng(0)
    few = Score(np.arange(40, 46), np.arange(6) * 1.5, np.arange(6) * 1.5 + 0.2, np.full(6, 50))
    noise = wave(tmp_path / "noise.wav", draw.uniform(0.1, 0.5, 20 * RATE))
    assert any(
        "of the loud time no note is heard" in doubt
        for doubt in transcribe(Recording.of(noise), Teller(few)).remarks
    )


@pytest.mark.parametrize(("start", "seconds"), [(0.0, 10.0), (3.0, 20.0), (595.0, 10.0)])
def test_an_excerpt_is_that_of_the_whole(tmp_path: Path, start: float, seconds: float) -> None:
    recording = Recording.of(ramp(tmp_path / "song.wav", LONG))
    said = some_notes(LONG)
    whole = transcribe(recording, Teller(said, ramp=True))
    listener = Teller(said, ramp=True)
    part = transcribe_excerpt(recording, start, seconds, listener)
    wanted, got = excerpt(whole, start, seconds), excerpt(part, start, seconds)
    for name in ("key", "onset", "offset", "velocity", "pedal"):
        np.testing.assert_array_equal(getattr(got, name), getattr(wanted, name))
    # In what is shared by stretches, some is heard twice.
    assert sum(listener.lengths) < start + seconds + 60
    assert part.onset.max() < start + seconds + 5


def test_an_excerpt_after_a_long_silence_is_found(tmp_path: Path) -> None:
    loud = np.full(60 * RATE, 0.3)
    loud[: 40 * RATE] = 0.0
    recording = Recording.of(wave(tmp_path / "song.wav", loud))
    onset = np.arange(40.0, 60.0)
    said = Score(np.full(20, 40), onset, onset + 0.5, np.full(20, 70))
    part = transcribe_excerpt(recording, 0.0, 5.0, Teller(said))
    np.testing.assert_array_equal(part.onset, onset)


@pytest.mark.parametrize(("start", "seconds"), [(-1.0, 5.0), (np.nan, 5.0), (0.0, 0.0)])
def test_a_part_of_no_song(tmp_path: Path, start: float, seconds: float) -> None:
    recording = Recording.of(tone(tmp_path / "song.wav"))
    with pytest.raises(InputError, match="must be"):
        transcribe_excerpt(recording, start, seconds, Teller(some_notes(3.0)))


def test_notes_that_begin_in_silence_are_none(tmp_path: Path) -> None:
    path = tmp_path / "song.wav"
    sound = np.full((10 * RATE, 1), 0.2)
    sound[4 * RATE : 6 * RATE] = 1e-4
    write_wav(path, sound, RATE)
    onset = np.arange(0.5, 10.0, 1.0)
    said = Score(np.full(10, 40), onset, onset + 0.9, np.full(10, 70))
    heard = transcribe(Recording.of(path), Teller(said))
    assert heard.onset.tolist() == [0.5, 1.5, 2.5, 3.5, 6.5, 7.5, 8.5, 9.5]


@pytest.mark.parametrize("content", [b"", b"no sound", b"RIFF\0\0\0\0WAVE"])
def test_what_is_no_sound(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "song.wav"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"not sound or a video that can be read|has no sound"):
        Recording.of(path)
    with pytest.raises(InputError, match="does not exist"):
        Recording.of(tmp_path / "nothing.mp3")
    with pytest.raises(InputError, match="is a folder"):
        Recording.of(tmp_path)


def test_too_long_a_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tone(tmp_path / "song.wav", 3.0)
    monkeypatch.setattr("pianomime.transcription.recording.MAX_SECONDS", 2.0)
    with pytest.raises(InputError, match="is longer than"):
        Recording.of(path)
    with pytest.raises(InputError, match="is longer than"):
        list(Recording(path, 1.0, None).stretches(RATE))


@given(st.lists(st.floats(0.0, 1.0, width=32), min_size=1, max_size=500))
@settings(max_examples=50)
def test_loudness_is_that_of_the_samples(values: list[float]) -> None:
    samples = np.array(values, np.float32)
    loudness = loudness_of(samples, 100)
    assert len(loudness) == -(-len(samples) // (100 // PARTS))
    assert np.sum(loudness.astype(float) ** 2 * 10) == pytest.approx(
        np.sum(samples.astype(float) ** 2), rel=1e-4, abs=1e-6
    )


def test_what_sounds_without_a_note_is_unexplained() -> None:
    loudness = Loudness([np.full(100, 0.2, np.float32), np.zeros(100, np.float32)])
    half = Score(np.array([40]), np.array([0.0]), np.array([4.0]), np.array([70]))
    assert loudness.unexplained(half) == pytest.approx(0.5)
    held = replace(half, pedal=np.array([[3.0, 9.0]]))
    assert loudness.unexplained(held) == pytest.approx(0.0)


def test_the_extra_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pianomime.transcription.listener.find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"transkun is needed.*install.*\[audio\]"):
        check_listener()


def test_torch_is_imported_by_nobody_else() -> None:
    """What may take notes from sound does not take the seconds that torch takes."""
    names = "pianomime.transcription.transcribe, pianomime.video.retarget"
    code = f"import sys, {names}; print(sorted({{'torch', 'transkun'}} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.skipif(not can_listen(), reason="the extra audio is not installed")
def test_the_network_hears_our_own_piano(tmp_path: Path) -> None:
    score = excerpt(Score.from_midi(songs.path("twinkle-twinkle")), seconds=6)
    path = tmp_path / "song.wav"
    write_wav(path, render_audio(score))
    heard = transcribe(Recording.of(path))
    metrics = music_metrics(score, heard)
    assert metrics.note_f1_50 is not None
    assert metrics.note_f1_50 > 0.9
    assert heard.remarks == ()
    assert "torchaudio" not in sys.modules
