"""Sound of a score, by a sampled piano if there is one, else by additive synthesis; WAV files.

The samples are those of the soundfont in pretty_midi's wheel, the synthesizer is midirenderer's:
both come with `pip install`, without a system library. (symusic, which reads the MIDI files, has a
synthesizer too; that of 0.6 cannot return its sound to Python, that of 0.5 ignores pedal and
velocity.)
"""

from __future__ import annotations

import io
import os
import warnings
import wave
from dataclasses import replace
from importlib.util import find_spec
from math import gcd
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.files import atomic
from pianomime.music.midi import midi_bytes
from pianomime.music.score import Score

SAMPLE_RATE = 48_000
"""[Hz] Sample rate of the synthesizer; any other takes a conversion."""

MAX_SECONDS = 600.0
"""[s] Longest sound; that of a song of three hours would take 4 GB."""

PEAK = 0.9
"""Amplitude of the loudest sample."""
TAIL = 1.5
"""[s] Time for the last note to fade."""

RING = 10.0
"""[s] Time after which every string has faded, so that the pedal makes no difference."""


def render_audio(score: Score, sample_rate: int = SAMPLE_RATE) -> NDArray[np.float32]:
    """Synthesize a score as a grand piano plays it.

    Notes sound as long as their key or the sustain pedal is down.

    Args:
        score: the music; what begins after 10 minutes is left out, with a warning.
        sample_rate: samples per second [Hz].

    Returns:
        (S, 2) float32, left and right, with the loudest sample at 0.9; silence for an empty
        score. It ends 1.5 s after the last note has been damped.
    """
    score = _audible(score)
    end = _damped(score)
    audio = np.zeros((round((end.max(initial=0.0) + TAIL) * sample_rate), 2), np.float32)
    if len(score) and not _play_samples(score, sample_rate, audio):
        _play_partials(score, end, sample_rate, audio)
    loudest = max(audio.max(), -audio.min())
    if loudest > 0:
        audio *= PEAK / loudest
    return audio


def write_wav(
    path: str | os.PathLike[str], audio: NDArray[np.floating], sample_rate: int = SAMPLE_RATE
) -> None:
    """Write a 16-bit WAV file.

    Args:
        path: the file; it is written in one step.
        audio: (S, C) samples of C channels; those beyond -1..1 are clipped.
        sample_rate: samples per second [Hz].

    Raises:
        ValueError: the audio has another shape.
    """
    if audio.ndim != 2:
        raise ValueError(f"audio must be (S, C), not {audio.shape}")
    with atomic(path) as temporary, wave.open(str(temporary), "wb") as file:
        file.setnchannels(audio.shape[1])
        file.setsampwidth(2)
        file.setframerate(sample_rate)
        # Second by second, to keep copies of long sounds out of memory.
        for first in range(0, len(audio), sample_rate):
            samples = np.clip(audio[first : first + sample_rate], -1, 1) * 32767
            file.writeframes(np.rint(samples).astype("<i2").tobytes())


def _audible(score: Score) -> Score:
    """The score without notes after `MAX_SECONDS`, and without pedal that holds only silence."""
    if score.duration > MAX_SECONDS:
        warnings.warn(
            f"only the first {MAX_SECONDS / 60:.0f} of {score.duration / 60:.0f} minutes "
            f"are made into sound",
            stacklevel=2,
        )
    heard = score.onset < MAX_SECONDS
    offset = np.minimum(score.offset[heard], MAX_SECONDS)
    return replace(
        score,
        key=score.key[heard],
        onset=score.onset[heard],
        offset=offset,
        velocity=score.velocity[heard],
        pedal=np.minimum(score.pedal, offset.max(initial=0.0) + RING),
    )


def _damped(score: Score) -> NDArray[np.float64]:
    """(N,) Time at which each note is damped [s]: both its key and the pedal are up."""
    down, up = np.append(np.full((1, 2), -1.0), score.pedal, axis=0).T
    at = np.searchsorted(down, score.offset, side="right") - 1
    damped: NDArray[np.float64] = np.maximum(score.offset, up[at])
    return damped


def _play_samples(score: Score, sample_rate: int, audio: NDArray[np.float32]) -> bool:
    """Write the sound of a sampled piano into (S, 2); returns False where there is none."""
    # Only located, because importing pretty_midi takes longer than synthesizing the music.
    library = find_spec("pretty_midi")
    if library is None or library.origin is None:
        return False
    # The synthesizer stops at the last event, so a pedal move is added after the sound has faded.
    end = len(audio) / sample_rate
    longer = replace(score, pedal=np.append(score.pedal, [[end - 0.01, end]], axis=0))
    try:
        # There is no wheel of midirenderer for some platforms, and no soundfont in the source
        # distribution of pretty_midi.
        from midirenderer import render_wave_from

        soundfont = Path(library.origin).with_name("TimGM6mb.sf2").read_bytes()
        samples, rate = _read_wav(render_wave_from(soundfont, midi_bytes(longer)))
    except (ImportError, OSError, RuntimeError):
        return False
    if rate != sample_rate:
        from scipy.signal import resample_poly

        common = gcd(sample_rate, rate)
        samples = resample_poly(samples.astype(np.float32), sample_rate // common, rate // common)
    samples = samples[: len(audio)]
    audio[: len(samples)] = samples
    return True


def _read_wav(content: bytes) -> tuple[NDArray[Any], int]:
    """(S, 2) 16-bit samples, and their rate [Hz]."""
    with wave.open(io.BytesIO(content)) as file:
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2")
        return samples.reshape(-1, 2), file.getframerate()


def _play_partials(
    score: Score, end: NDArray[np.float64], sample_rate: int, audio: NDArray[np.float32]
) -> None:
    """Add the sound of six decaying partials per key, with the bass to the left.

    Args:
        score: the music.
        end: (N,) time at which each note is damped [s].
        sample_rate: samples per second [Hz].
        audio: (S, 2) the sound is added to this array.
    """
    release = np.exp(-np.arange(sample_rate // 2) / (0.08 * sample_rate)).astype(np.float32)
    for key in np.unique(score.key).tolist():
        pitch = 440.0 * 2 ** ((key - 48) / 12)
        ring = 3.0 * 2 ** (-key / 24)
        string = np.zeros(round(7 * ring * sample_rate), np.float32)
        for partial in range(1, 7):
            if partial * pitch < sample_rate / 2:
                # Higher partials fade sooner.
                time = np.arange(len(string) // partial) / sample_rate
                decay = np.exp(-time * partial / ring) / partial**1.5
                string[: len(time)] += decay * np.sin(2 * np.pi * partial * pitch * time)
        place = np.pi / 4 + (key - 43.5) / 43.5 * np.pi / 10
        sides = np.array([np.cos(place), np.sin(place)], np.float32)
        notes = np.flatnonzero(score.key == key)
        # A key that is struck again stops its previous note.
        stop = np.minimum(end[notes], np.append(score.onset[notes[1:]], np.inf))
        first = np.rint(score.onset[notes] * sample_rate).astype(int)
        held = np.rint((stop - score.onset[notes]) * sample_rate).astype(int)
        loudness = (score.velocity[notes] / 127) ** 2
        for begin, length, gain in zip(first.tolist(), held.tolist(), loudness, strict=True):
            note = np.float32(gain) * string[: length + len(release)]
            note[length:] *= release[: len(note[length:])]
            part = audio[begin : begin + len(note)]
            part += note[: len(part), None] * sides
