"""From a recording to a score: notes with velocities and pedal, and what is doubtful about them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.music.excerpt import check_part
from pianomime.music.score import Score
from pianomime.progress import Progress, no_progress
from pianomime.shown import title_of
from pianomime.transcription.listener import Listener, find_listener
from pianomime.transcription.loudness import Loudness, loudness_of
from pianomime.transcription.recording import Recording, Stretch

_FEW, _RARE = 5, 0.2
"""Notes in all, and a second, below which there are hardly any."""
_FINGERS = 10
"""Notes that two hands can begin at once."""
_AT_ONCE = 0.03
"""[s] In which notes of a chord begin."""
_STEADY = 0.8
"""Loudness at the end of a held note, as a share of that at its beginning, from which it does not
fade as a string does that was struck."""
_UNEXPLAINED = 0.3
"""Share of the loud time without a note from which something else is heard."""
_SILENCE = 4.0
"""[s] Silence before an excerpt for which no more than the excerpt has to be heard."""
_TWICE = 0.03
"""[s] Two strikes of a key are further apart: nearer ones are one, heard in two stretches."""


def transcribe(
    recording: Recording,
    listener: Listener | None = None,
    progress: Progress = no_progress,
    until: float = math.inf,
) -> Score:
    """Write down the notes of a recording of a piano.

    Args:
        recording: the recording.
        listener: who hears the notes; transkun if not given.
        progress: called in the phase "listening", with seconds.
        until: end of the onsets that are wanted [s]; what comes later is not heard.

    Returns:
        The score, in the time of the recording, with its doubts as `remarks`.

    Raises:
        InputError: the recording is silent, no notes are heard in it, or it cannot be read; or
            transkun is not installed.
    """
    total = round(min(recording.seconds, until))
    progress("listening", 0, total)
    if listener is None:
        listener = find_listener()
    heard: list[Score] = []
    loudness: list[NDArray[np.float32]] = []
    for stretch in recording.stretches(listener.rate, until):
        first, stop = stretch.own
        loudness.append(loudness_of(stretch.samples[first:stop], listener.rate))
        if not (loudness[-1] > 0).any():
            continue
        tell = _teller(progress, stretch, total)
        heard.append(_own(listener.hear(stretch.samples, tell), stretch, listener.rate))
    whole = Loudness(loudness)
    if whole.silent:
        raise InputError(f"{recording.path}: is silent")
    score = _joined(heard, whole, title_of(recording.path))
    if not len(score):
        raise InputError(f"{recording.path}: no notes of a piano are heard in it")
    return replace(score, remarks=_doubts(score, whole))


def transcribe_excerpt(
    recording: Recording,
    start: float,
    seconds: float,
    listener: Listener | None = None,
    progress: Progress = no_progress,
) -> Score:
    """Write down as much of a recording as `excerpt` asks for, and perhaps more.

    Args:
        recording: the recording.
        start: where the excerpt begins [s].
        seconds: its length from the first note there on [s]; may be infinite.
        listener: who hears the notes; transkun if not given.
        progress: called in the phase "listening", with seconds.

    Returns:
        As `transcribe` does. It equals that of the whole recording to the end of the excerpt.

    Raises:
        InputError: as `transcribe` does; or a time is out of range.
    """
    check_part(start, seconds)
    until = start + seconds + _SILENCE
    if listener is None:
        listener = find_listener()
    if until < recording.seconds:
        try:
            score = transcribe(recording, listener, progress, until)
        except InputError:
            pass  # It may be silent there alone.
        else:
            sounding = score.onset[score.offset > start]
            if len(sounding) and max(start, sounding[0]) + seconds <= until:
                return score
    return transcribe(recording, listener, progress)


def _teller(progress: Progress, stretch: Stretch, total: int) -> Callable[[float], None]:
    """What takes note of how much of a stretch has been heard."""

    def tell(seconds: float) -> None:
        done = round(stretch.begin + seconds)
        progress("listening", done, max(total, done))

    return tell


def _own(score: Score, stretch: Stretch, rate: int) -> Score:
    """Notes and pedal that begin in what is a stretch's own, in the time of the recording."""
    first, stop = (edge / rate for edge in stretch.own)

    def begins(onset: NDArray[np.float64]) -> NDArray[np.bool_]:
        return (onset >= first) & (onset < stop)

    note, foot = begins(score.onset), begins(score.pedal[:, 0])
    return replace(
        score,
        key=score.key[note],
        onset=score.onset[note] + stretch.begin,
        offset=score.offset[note] + stretch.begin,
        velocity=score.velocity[note],
        pedal=score.pedal[foot] + stretch.begin,
    )


def _joined(heard: list[Score], loudness: Loudness, title: str) -> Score:
    """The notes of all stretches, without those that begin in silence or are heard twice."""

    def all_of(name: str) -> NDArray[np.float64]:
        return np.concatenate([getattr(score, name) for score in heard])

    key, onset = all_of("key").astype(np.int64), all_of("onset")
    order = np.lexsort((onset, key))
    again = np.zeros(len(key), bool)
    again[order[1:]] = (np.diff(key[order]) == 0) & (np.diff(onset[order]) < _TWICE)
    kept = loudness.struck(onset) & ~again
    return Score(
        key[kept],
        onset[kept],
        all_of("offset")[kept],
        all_of("velocity")[kept].astype(np.int64),
        all_of("pedal"),
        title,
    )


def _doubts(score: Score, loudness: Loudness) -> tuple[str, ...]:
    """One line for each reason to doubt the score."""
    doubts = []
    if len(score) < max(_FEW, _RARE * loudness.seconds):
        doubts.append(
            f"hardly any notes are heard: {len(score)} in {loudness.seconds:.0f} s; is it a piano?"
        )
    share = loudness.unexplained(score)
    if share > _UNEXPLAINED:
        doubts.append(
            f"in {share:.0%} of the loud time no note is heard: of voices, other instruments and "
            "noise nothing is written down"
        )
    steady = loudness.steadiness(score)
    if steady > _STEADY:
        doubts.append(
            f"notes that are held stay as loud as they begin ({steady:.0%} of it): is it a piano?"
        )
    crowd, at = _most_at_once(score)
    if crowd > _FINGERS:
        doubts.append(
            f"{crowd} notes begin at once at {at:.1f} s, more than two hands have fingers: is it "
            "one piano?"
        )
    return tuple(doubts)


def _most_at_once(score: Score) -> tuple[int, float]:
    """The greatest number of notes that begin at once, and when they do [s]."""
    if not len(score):
        return 0, 0.0
    stop = np.searchsorted(score.onset, score.onset + _AT_ONCE, side="right")
    count = stop - np.arange(len(score))
    first = int(np.argmax(count))
    return int(count[first]), float(score.onset[first])
