"""Sound of a score, a minute at a time: a sampled piano if there is one, else additive synthesis.

The samples are those of the soundfont in pretty_midi's wheel, the synthesizer is midirenderer's:
both come with `pip install`, without a system library.
"""

from __future__ import annotations

import io
import warnings
import wave
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from math import gcd
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.music.midi import midi_bytes
from pianomime.music.score import Score
from pianomime.progress import ignore

SAMPLE_RATE = 48_000
"""[Hz] Sample rate of the synthesizer; any other takes a conversion."""

MAX_SECONDS = 600.0
"""[s] Longest sound in one array: an hour would take 1.4 GB. `Sound` has no such limit."""

BLOCK_SECONDS = 60
"""[s] Sound that is made at a time."""

PEAK = 0.9
"""Amplitude of the loudest sample."""
TAIL = 1.5
"""[s] Time for the last note to fade."""

_LIVE_AHEAD = 0.02
"""[s] The synthesizer may stop a sample before the last event."""

RING = 10
"""[s] Time after which every string has faded, so that neither key nor pedal makes a difference."""


class Sound:
    """The sound of a score of any length as a grand piano plays it, made a minute at a time.

    Notes sound as long as their key or the sustain pedal is down.

    Attributes:
        sample_rate: samples per second [Hz].
        samples: number of samples S; it ends 1.5 s after the last note has been damped.
        block_count: number of blocks.

    Args:
        score: the music.
        sample_rate: samples per second [Hz].
    """

    def __init__(self, score: Score, sample_rate: int = SAMPLE_RATE) -> None:
        # Pedal that holds only silence makes no sound.
        end = score.offset.max(initial=0.0) + RING
        self._score = replace(score, pedal=np.minimum(score.pedal, end))
        self._end = _damped(self._score)
        self.sample_rate = sample_rate
        self.samples = round((self._end.max(initial=0.0) + TAIL) * sample_rate)
        self._block = BLOCK_SECONDS * sample_rate
        self.block_count = -(-self.samples // self._block)

    def blocks(self, advance: Callable[[int], None] = ignore) -> Iterator[NDArray[np.float32]]:
        """Make the sound twice: to find the loudest sample, and once more to scale it.

        Args:
            advance: called with 1 after each block, both times.

        Yields:
            (s, 2) left and right, one block after the other; the loudest sample of all is at 0.9.
        """
        play, loudest, only = self._loudest(advance)
        for index in range(self.block_count):
            audio = play(index) if only is None else only
            if loudest > 0:
                audio *= PEAK / loudest
            yield audio
            advance(1)

    def _loudest(
        self, advance: Callable[[int], None]
    ) -> tuple[Callable[[int], NDArray[np.float32]], float, NDArray[np.float32] | None]:
        """What plays a block, the greatest amplitude, and the sound if it is one block alone."""
        for play in (self._samples, self._partials):
            loudest, audio = 0.0, None
            try:
                for index in range(self.block_count):
                    audio = play(index)
                    loudest = max(loudest, audio.max(), -audio.min())
                    advance(1)
            except _NoSamplesError:
                continue
            return play, loudest, audio if self.block_count == 1 else None
        raise AssertionError("additive synthesis needs nothing")

    def _samples(self, index: int) -> NDArray[np.float32]:
        """(s, 2) A block of the sound of a sampled piano.

        Raises:
            _NoSamplesError: there is no such piano.
        """
        begin = index * BLOCK_SECONDS
        count = min(self._block, self.samples - index * self._block)
        # A conversion looks ahead.
        ahead = TAIL if index + 1 < self.block_count else 0.0
        return _samples_between(self._score, begin, count, ahead, self.sample_rate)

    def _partials(self, index: int) -> NDArray[np.float32]:
        """(s, 2) A block of the sound of decaying partials, with the bass to the left."""
        first = index * self._block
        audio = np.zeros((min(self._block, self.samples - first), 2), np.float32)
        _play_partials(self._score, self._end, self.sample_rate, first, audio)
        return audio


def live_sound(
    score: Score, begin: float, seconds: float, sample_rate: int = SAMPLE_RATE
) -> NDArray[np.float32]:
    """The sound of a stretch of music whose end is not known yet. It is not scaled.

    Stretches that follow one another are one sound, as long as what was to come changes no note of
    before.

    Args:
        score: all that was played so far, up to the end of the stretch; a note that still sounds
            then ends later.
        begin: where the stretch begins, a multiple of 1 / `sample_rate` [s].
        seconds: its length.
        sample_rate: samples per second [Hz].

    Returns:
        (s, 2) left and right.
    """
    count = round(seconds * sample_rate)
    try:
        return _samples_between(score, begin, count, _LIVE_AHEAD, sample_rate)
    except _NoSamplesError:
        audio = np.zeros((count, 2), np.float32)
        _play_partials(score, _damped(score), sample_rate, round(begin * sample_rate), audio)
        return audio


def _samples_between(
    score: Score, begin: float, count: int, ahead: float, sample_rate: int
) -> NDArray[np.float32]:
    """(count, 2) The sound of a sampled piano from a time [s] on.

    Raises:
        _NoSamplesError: there is no such piano.
    """
    audio = np.zeros((count, 2), np.float32)
    if not len(score):
        return audio
    # What was struck before still sounds; all voices begin where they would in the whole.
    origin = begin - min(begin, RING)
    stop = begin + count / sample_rate + ahead
    heard = (score.onset >= origin) & (score.onset < stop)
    # The synthesizer stops at the last event, so a pedal move is added at the end.
    end = stop - origin
    pedal = np.clip(score.pedal - origin, 0.0, end)
    part = replace(
        score,
        key=score.key[heard],
        onset=score.onset[heard] - origin,
        offset=np.minimum(score.offset[heard] - origin, end),
        velocity=score.velocity[heard],
        pedal=np.append(pedal, [[end - 0.01, end]], axis=0),
    )
    first = round((begin - origin) * sample_rate)
    made = _synthesized(part, sample_rate)[first:][:count]
    audio[: len(made)] = made
    return audio


def render_audio(score: Score, sample_rate: int = SAMPLE_RATE) -> NDArray[np.float32]:
    """Synthesize a score as `Sound` does, into one array.

    Args:
        score: the music; what begins after 10 minutes is left out, with a warning.
        sample_rate: samples per second [Hz].

    Returns:
        (S, 2) float32, left and right, with the loudest sample at 0.9; silence for an empty
        score. It ends 1.5 s after the last note has been damped.
    """
    sound = Sound(_beginning(score), sample_rate)
    audio = np.empty((sound.samples, 2), np.float32)
    first = 0
    for block in sound.blocks():
        audio[first : first + len(block)] = block
        first += len(block)
    return audio


def _beginning(score: Score) -> Score:
    """The score without what comes after `MAX_SECONDS`."""
    if score.duration <= MAX_SECONDS:
        return score
    warnings.warn(
        f"only the first {MAX_SECONDS / 60:.0f} of {score.duration / 60:.0f} minutes "
        f"are made into sound",
        stacklevel=3,
    )
    heard = score.onset < MAX_SECONDS
    return replace(
        score,
        key=score.key[heard],
        onset=score.onset[heard],
        offset=np.minimum(score.offset[heard], MAX_SECONDS),
        velocity=score.velocity[heard],
    )


def _damped(score: Score) -> NDArray[np.float64]:
    """(N,) Time at which each note is damped [s]: both its key and the pedal are up."""
    down, up = np.append(np.full((1, 2), -1.0), score.pedal, axis=0).T
    at = np.searchsorted(down, score.offset, side="right") - 1
    damped: NDArray[np.float64] = np.maximum(score.offset, up[at])
    return damped


class _NoSamplesError(Exception):
    """There is no synthesizer, or no soundfont."""


def _synthesized(score: Score, sample_rate: int) -> NDArray[Any]:
    """(S, 2) Samples of a sampled piano, up to the last event.

    Raises:
        _NoSamplesError: there is none.
    """
    # Only located, because importing pretty_midi takes longer than synthesizing the music.
    library = find_spec("pretty_midi")
    if library is None or library.origin is None:
        raise _NoSamplesError
    try:
        # There is no wheel of midirenderer for some platforms, and no soundfont in the source
        # distribution of pretty_midi.
        from midirenderer import render_wave_from

        soundfont = Path(library.origin).with_name("TimGM6mb.sf2").read_bytes()
        samples, rate = _read_wav(render_wave_from(soundfont, midi_bytes(score)))
    except (ImportError, OSError, RuntimeError) as error:
        raise _NoSamplesError from error
    if rate == sample_rate:
        return samples
    from scipy.signal import resample_poly

    common = gcd(sample_rate, rate)
    converted: NDArray[Any] = resample_poly(
        samples.astype(np.float32), sample_rate // common, rate // common
    )
    return converted


def _read_wav(content: bytes) -> tuple[NDArray[Any], int]:
    """(S, 2) 16-bit samples, and their rate [Hz]."""
    with wave.open(io.BytesIO(content)) as file:
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2")
        return samples.reshape(-1, 2), file.getframerate()


def _play_partials(
    score: Score,
    end: NDArray[np.float64],
    sample_rate: int,
    first: int,
    audio: NDArray[np.float32],
) -> None:
    """Add the sound of six decaying partials per key, with the bass to the left.

    Args:
        score: the music.
        end: (N,) time at which each note is damped [s].
        sample_rate: samples per second [Hz].
        first: number of the sample at which the array begins.
        audio: (S, 2) the sound is added to this array.
    """
    release = np.exp(-np.arange(sample_rate // 2) / (0.08 * sample_rate)).astype(np.float32)
    for key in np.unique(score.key).tolist():
        notes = np.flatnonzero(score.key == key)
        # A key that is struck again stops its previous note.
        stop = np.minimum(end[notes], np.append(score.onset[notes[1:]], np.inf))
        begins = np.rint(score.onset[notes] * sample_rate).astype(int) - first
        held = np.rint((stop - score.onset[notes]) * sample_rate).astype(int)
        loudness = (score.velocity[notes] / 127) ** 2
        heard = (begins < len(audio)) & (begins + held + len(release) > 0)
        if not heard.any():
            continue
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
        for begin, length, gain in zip(
            begins[heard].tolist(), held[heard].tolist(), loudness[heard], strict=True
        ):
            note = np.float32(gain) * string[: length + len(release)]
            note[length:] *= release[: len(note[length:])]
            note = note[max(-begin, 0) :]
            part = audio[max(begin, 0) :][: len(note)]
            part += note[: len(part), None] * sides
