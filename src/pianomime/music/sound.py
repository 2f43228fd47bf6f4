"""The sound of a score: a small piano made of decaying partials, and WAV files.

A sampled piano was tried first. The synthesizer of symusic 0.6 cannot return its sound to Python,
that of 0.5 ignores the pedal and the velocity, and the free soundfonts are larger than the rest of
PianoMime. This one hears pedal and velocity, is the same on every machine and needs only NumPy.
"""

from __future__ import annotations

import os
import wave

import numpy as np
from numpy.typing import NDArray

from pianomime.files import atomic
from pianomime.music.score import Score

PEAK = 0.9
TAIL = 1.0
"""Seconds left for the last note to fade."""

FIRST_UNDAMPED_KEY = 69
"""From F#6 up a piano has no dampers: these keys ring until they have faded."""


def render_audio(score: Score, sample_rate: int = 44100) -> NDArray[np.float32]:
    """Play a score on a synthetic piano.

    Notes sound as long as their key or the sustain pedal is down, bass to the left.

    Args:
        score: what to play.
        sample_rate: samples a second.

    Returns:
        (S, 2) float32, left and right, the loudest sample at 0.9; silence for an empty score. It
        lasts until the last note has been damped, and 1 s more.
    """
    damped = _damped(score)
    audio = np.zeros((round((damped.max(initial=0.0) + TAIL) * sample_rate), 2), np.float32)
    strings: dict[int, tuple[NDArray[np.float32], NDArray[np.float32]]] = {}
    for key, onset, end, velocity in zip(
        score.key.tolist(),
        score.onset.tolist(),
        damped.tolist(),
        score.velocity.tolist(),
        strict=True,
    ):
        if key not in strings:
            strings[key] = _strings(key, sample_rate)
        soft, hard = strings[key]
        first = round(onset * sample_rate)
        held = round((end - onset) * sample_rate)
        fade = _fade(key, sample_rate)
        count = min(len(soft), len(audio) - first)
        if key < FIRST_UNDAMPED_KEY:
            count = min(count, held + len(fade))
        loudness = velocity / 127
        # A harder blow is louder, and brighter.
        note = loudness**1.5 * ((1 - loudness) * soft[:count] + loudness * hard[:count])
        if key < FIRST_UNDAMPED_KEY and held < count:
            note[held:] *= fade[: count - held]
        pan = np.pi / 4 + (key - 43.5) / 43.5 * np.pi / 10
        audio[first : first + count, 0] += np.cos(pan) * note
        audio[first : first + count, 1] += np.sin(pan) * note
    loudest = np.abs(audio).max(initial=0.0)
    if loudest > 0:
        audio *= PEAK / loudest
    return audio


def write_wav(
    path: str | os.PathLike[str], audio: NDArray[np.floating], sample_rate: int = 44100
) -> None:
    """Write a 16-bit WAV file; samples beyond -1..1 are limited.

    Args:
        path: the file, written in one step.
        audio: (S, C), C channels.
        sample_rate: samples a second.

    Raises:
        ValueError: the audio has another shape.
    """
    if audio.ndim != 2:
        raise ValueError(f"audio must be (S, C), not {audio.shape}")
    samples = np.rint(np.clip(audio, -1, 1) * 32767).astype("<i2")
    with atomic(path) as temporary, wave.open(str(temporary), "wb") as file:
        file.setnchannels(samples.shape[1])
        file.setsampwidth(2)
        file.setframerate(sample_rate)
        file.writeframes(samples.tobytes())


def _damped(score: Score) -> NDArray[np.float64]:
    """(N,) When the damper falls on each note [s]: key and pedal are up, or it is struck again."""
    end = score.offset.copy()
    for down, up in score.pedal.tolist():
        end[(score.offset >= down) & (score.offset < up)] = up
    order = np.lexsort((score.onset, score.key))
    same_key = np.diff(score.key[order]) == 0
    earlier, later = order[:-1][same_key], order[1:][same_key]
    end[earlier] = np.minimum(end[earlier], score.onset[later])
    return end


def _strings(key: int, sample_rate: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """A key struck softly and struck hard, ringing until it has faded: two arrays of (S,).

    Stiff strings sound sharper the higher the partial (inharmonicity), high partials fade first,
    and every partial fades fast at first and slowly later (the strings of a key drift apart).
    """
    pitch = 440.0 * 2 ** ((key - 48) / 12)
    stiffness = 1.2e-4 * np.exp(0.065 * max(key - 24, 0))
    ring = 5.0 * 2 ** (-key / 20)
    samples = round(4 * ring * sample_rate)
    soft, hard = np.zeros(samples, np.float32), np.zeros(samples, np.float32)
    for partial in range(1, 25):
        frequency = partial * pitch * np.sqrt(1 + stiffness * partial**2)
        if partial > 1 and frequency > min(0.45 * sample_rate, 12_000):
            break
        decay = ring / (1 + 0.2 * (partial - 1))
        count = min(samples, round(5 * decay * sample_rate))
        turn = 2j * np.pi * frequency
        # Golden-ratio phases: no two partials begin in step, so that there is no click.
        begin = np.exp(2j * np.pi * 0.618 * partial)
        fast = _powers(np.exp((turn - 3 / decay) / sample_rate), count)
        slow = _powers(np.exp((turn - 1 / decay) / sample_rate), count)
        sound = (np.complex64(0.6 * begin) * fast + np.complex64(0.4 * begin) * slow).imag
        # The hammer strikes at one eighth of the string, where the eighth partial has a node.
        strength = abs(np.sin(np.pi * partial / 8)) + 0.05
        soft[:count] += np.float32(strength * partial**-2.0) * sound
        hard[:count] += np.float32(strength * partial**-0.9) * sound
    # The blow itself takes 2 ms, and what is left in the end is faded out; treble is softer.
    shape = np.full(samples, 2 ** (-key / 60), np.float32)
    blow, out = round(0.002 * sample_rate), samples // 10
    shape[:blow] *= np.linspace(0, 1, blow, endpoint=False, dtype=np.float32)
    shape[-out:] *= np.linspace(1, 0, out, dtype=np.float32)
    return shape * soft / np.abs(soft).max(), shape * hard / np.abs(hard).max()


def _powers(base: complex, count: int) -> NDArray[np.complex64]:
    """base**0 .. base**(count-1), far faster than sines: blocks are multiples of the first one."""
    block = 1024
    within = (base ** np.arange(block)).astype(np.complex64)
    blocks = (base ** (block * np.arange(count // block + 1))).astype(np.complex64)
    return np.outer(blocks, within).ravel()[:count]


def _fade(key: int, sample_rate: int) -> NDArray[np.float32]:
    """What a falling damper leaves of the sound, sample by sample; bass strings take longer."""
    seconds = 0.05 + 0.1 * (1 - key / 87)
    time = np.arange(round(6 * seconds * sample_rate)) / sample_rate
    return np.exp(-time / seconds).astype(np.float32)
