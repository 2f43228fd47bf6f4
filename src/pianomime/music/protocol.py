"""The `music` protocol: how well a playing matches a score to an ear, note by note in true time.

It compares what was played with what was wanted as events: when each key was struck and let go, and
how hard. Nothing is cut to frames, and no lag is taken off. The other protocol, of the paper, is
`pianomime.music.metrics.frame_metrics`.

Numbers can be compared only where `protocol_digest` is the same.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.music.key_time import key_seconds, overlap, strikes
from pianomime.music.matching import Candidates, rounded
from pianomime.music.score import Score
from pianomime.music.voices import BASS, INNER, MELODY, voices

PROTOCOL_VERSION = 1
"""Raised whenever a number comes out differently for the same playing."""


@dataclass(frozen=True)
class Constants:
    """All constants of the protocol.

    Attributes:
        onset_tolerances: of note F1 [s]. The first is mir_eval's, as in music transcription.
        offset_share, offset_least: an offset may differ by this share of the wanted note's length,
            but always by so much [s] (mir_eval).
        velocity_steps: greatest difference of MIDI velocities (CANTABILE, arXiv 2609.18213).
        velocity_share: and of rescaled ones, of the range of the score's velocities (mir_eval).
        match: a strike within this time of a wanted note may be that note, however badly timed [s];
            what is further off is another note to an ear (our choice).
        repeat: a note is repeated where its key was let go less than this before [s] (our choice).
        chord: notes struck within this time are a chord [s]: pianists play the melody's note of a
            chord some 30 ms before the others (Goebl, JASA 110, 2001).
        pedal: greatest difference of the pedal's lifts [s] (our choice: as for onsets).
    """

    onset_tolerances: tuple[float, ...] = (0.050, 0.025, 0.010)
    offset_share: float = 0.2
    offset_least: float = 0.050
    velocity_steps: int = 8
    velocity_share: float = 0.1
    match: float = 0.150
    repeat: float = 0.5
    chord: float = 0.030
    pedal: float = 0.050


CONSTANTS = Constants()
"""Those of `PROTOCOL_VERSION`."""


def protocol_digest() -> str:
    """What the protocol is known by in results: 16 hexadecimal digits of its version and constants.

    They are the first of the SHA-256 of both as JSON.
    """
    content = json.dumps([PROTOCOL_VERSION, asdict(CONSTANTS)], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Voice:
    """Notes of one voice.

    Attributes:
        notes: how many the score has.
        never_struck: how many of them have no strike of their own within 150 ms.
        share: `never_struck` / `notes`; None without notes.
    """

    notes: int
    never_struck: int
    share: float | None


@dataclass(frozen=True)
class MusicMetrics:
    """Measures of the `music` protocol; None where there is nothing to measure.

    *Matched* notes are those of the largest one-to-one matching of strikes with wanted notes on the
    same key within 150 ms; of several, that with the least sum of errors.

    Attributes:
        notes: number of wanted notes.
        strikes: number of played notes.
        note_precision_50, note_recall_50, note_f1_50: key and onset right, within 50 ms, in the
            largest one-to-one matching (mir_eval), 0..1; so also within 25 and 10 ms.
        note_offset_precision_50, note_offset_recall_50, note_offset_f1_50: and the offset within
            50 ms or 20 % of the wanted note's length, the greater of the two (mir_eval); so also
            for onsets within 25 and 10 ms.
        velocity_f1: key, onset within 50 ms, and MIDI velocity within 8 steps.
        velocity_f1_rescaled: as `mir_eval.transcription_velocity` without offsets: the played
            velocities are first fitted to the wanted ones by a line. A fit forgives playing that is
            all too loud, and also playing that knows no velocities at all where the wanted ones
            hardly vary.
        velocity_correlation: Pearson's, of wanted and played velocities of matched notes; None
            where one of them never varies.
        onset_error_ms: 5th, 50th and 95th percentile over matched notes, late is positive [ms].
        offset_error_ms: the same of their offsets [ms].
        phantoms: number of strikes that are not matched.
        phantoms_per_minute: of the score's length.
        never_struck: share of the wanted notes that are not matched.
        repeats: number of wanted notes whose key was let go less than 0.5 s before.
        restruck: share of these that are matched: that have a strike of their own.
        chords: number of groups of wanted notes whose onsets lie within 30 ms of the group's first,
            of which two or more are matched.
        chord_spread_p50_ms, chord_spread_p90_ms: percentiles over chords of the time from the first
            to the last strike of the matched notes [ms].
        chord_spread_wanted_p90_ms: the same of the score's onsets of these notes [ms].
        pedal_lifts: number of times that the score lifts the pedal before its last note ends.
        pedal_lifts_kept: share of these with a lift of their own within 50 ms.
        key_time_f1: F1 of the time that keys are down, of all keys together (micro average), exact.
        melody, bass, inner: matched and unmatched notes by voice: the highest note that sounds at
            its onset, the lowest, and those between.
    """

    notes: int
    strikes: int
    note_precision_50: float | None
    note_recall_50: float | None
    note_f1_50: float | None
    note_precision_25: float | None
    note_recall_25: float | None
    note_f1_25: float | None
    note_precision_10: float | None
    note_recall_10: float | None
    note_f1_10: float | None
    note_offset_precision_50: float | None
    note_offset_recall_50: float | None
    note_offset_f1_50: float | None
    note_offset_precision_25: float | None
    note_offset_recall_25: float | None
    note_offset_f1_25: float | None
    note_offset_precision_10: float | None
    note_offset_recall_10: float | None
    note_offset_f1_10: float | None
    velocity_f1: float | None
    velocity_f1_rescaled: float | None
    velocity_correlation: float | None
    onset_error_ms: tuple[float, float, float] | None
    offset_error_ms: tuple[float, float, float] | None
    phantoms: int
    phantoms_per_minute: float | None
    never_struck: float | None
    repeats: int
    restruck: float | None
    chords: int
    chord_spread_p50_ms: float | None
    chord_spread_p90_ms: float | None
    chord_spread_wanted_p90_ms: float | None
    pedal_lifts: int
    pedal_lifts_kept: float | None
    key_time_f1: float | None
    melody: Voice
    bass: Voice
    inner: Voice


def match_notes(score: Score, played: Score) -> Candidates:
    """Match strikes with the wanted notes that they stand for, as `MusicMetrics` has it.

    Args:
        score: what was to be played.
        played: what was played, in the same time.

    Returns:
        The matched pairs; strikes in none of them are phantoms.
    """
    return Candidates.of(score, played, CONSTANTS.match).nearest()


def music_metrics(score: Score, played: Score) -> MusicMetrics:
    """Measure a playing against a score by the `music` protocol.

    Both are heard as one piano sounds them: a note ends at the latest where its key is struck
    again (`pianomime.music.key_time.strikes`).

    Args:
        score: what was to be played.
        played: what was played, in the same time: 0 s is the same instant in both.
    """
    wanted, heard = strikes(score), strikes(played)
    near = Candidates.of(wanted, heard, CONSTANTS.match)
    matched = match_notes(wanted, heard)
    struck = np.zeros(len(wanted), bool)
    struck[matched.wanted] = True
    phantoms = len(heard) - len(matched.late)
    never_struck = int(np.count_nonzero(~struck))
    repeated = _repeated(wanted)
    repeats, restruck = int(np.count_nonzero(repeated)), int(np.count_nonzero(repeated & struck))
    lifts, kept = _pedal_lifts(score, played)
    return MusicMetrics(
        notes=len(wanted),
        strikes=len(heard),
        **_note_scores(near, wanted, heard),
        velocity_correlation=_correlation(
            wanted.velocity[matched.wanted], heard.velocity[matched.played]
        ),
        onset_error_ms=_percentiles(matched.late),
        offset_error_ms=_percentiles(heard.offset[matched.played] - wanted.offset[matched.wanted]),
        phantoms=phantoms,
        phantoms_per_minute=_ratio(60 * phantoms, score.duration),
        never_struck=_ratio(never_struck, len(wanted)),
        repeats=repeats,
        restruck=_ratio(restruck, repeats),
        **_chords(wanted, heard, matched),
        pedal_lifts=lifts,
        pedal_lifts_kept=_ratio(kept, lifts),
        key_time_f1=_key_time_f1(wanted, heard),
        **_by_voice(wanted, struck),
    )


def _note_scores(near: Candidates, wanted: Score, heard: Score) -> dict[str, Any]:
    """Precision, recall and F1 of notes, and the F1 of velocities."""
    sizes = len(heard), len(wanted)
    error = np.abs(near.late)
    ends = near.offsets_fit(wanted, heard, CONSTANTS.offset_share, CONSTANTS.offset_least)
    scores: dict[str, float | None] = {}
    for tolerance in CONSTANTS.onset_tolerances:
        name = f"{1000 * tolerance:.0f}"
        begins = error <= tolerance
        for what, fits in (("note", begins), ("note_offset", begins & ends)):
            hits = near.where(fits).most()
            for part, count in zip(("precision", "recall"), sizes, strict=True):
                # As in mir_eval, the precision is 0 where nothing is played but something wanted.
                scores[f"{what}_{part}_{name}"] = _ratio(hits, count or min(sum(sizes), 1))
            scores[f"{what}_f1_{name}"] = _ratio(2 * hits, sum(sizes))
    in_time = near.where(error <= CONSTANTS.onset_tolerances[0])
    asked, given = wanted.velocity[in_time.wanted], heard.velocity[in_time.played]
    hits = in_time.where(np.abs(given - asked) <= CONSTANTS.velocity_steps).most()
    scores["velocity_f1"] = _ratio(2 * hits, sum(sizes))
    hits = _rescaled_hits(in_time.nearest(), wanted, heard)
    scores["velocity_f1_rescaled"] = _ratio(2 * hits, sum(sizes))
    return scores


def _rescaled_hits(matched: Candidates, wanted: Score, heard: Score) -> int:
    """Number of matched notes whose velocity is right after a fit (mir_eval)."""
    if not len(matched.late):
        return 0
    low, high = wanted.velocity.min(), wanted.velocity.max()
    asked = (wanted.velocity[matched.wanted] - low) / max(high - low, 1)
    given = heard.velocity[matched.played]
    line = np.stack([given, np.ones(len(given))], axis=1)
    fitted = line @ np.linalg.lstsq(line, asked, rcond=None)[0]
    return int(np.count_nonzero(np.abs(fitted - asked) < CONSTANTS.velocity_share))


def _repeated(wanted: Score) -> NDArray[np.bool_]:
    """(N,) Whether the key of a note was let go less than `repeat` before."""
    order = np.lexsort((wanted.onset, wanted.key))
    again = np.zeros(len(wanted), bool)
    pause = wanted.onset[order[1:]] - wanted.offset[order[:-1]]
    again[order[1:]] = (np.diff(wanted.key[order]) == 0) & (rounded(pause) < CONSTANTS.repeat)
    return again


def _chords(wanted: Score, heard: Score, matched: Candidates) -> dict[str, Any]:
    """How far apart the notes of chords were struck."""
    strike = np.full(len(wanted), np.nan)
    strike[matched.wanted] = heard.onset[matched.played]
    spreads, wanted_spreads = [], []
    onset, first = rounded(wanted.onset), 0
    while first < len(wanted):
        latest = rounded(onset[first] + CONSTANTS.chord)
        stop = int(np.searchsorted(onset, latest, side="right"))
        notes = first + np.flatnonzero(~np.isnan(strike[first:stop]))
        if len(notes) > 1:
            spreads.append(np.ptp(strike[notes]))
            wanted_spreads.append(np.ptp(wanted.onset[notes]))
        first = stop
    return {
        "chords": len(spreads),
        "chord_spread_p50_ms": _percentile(spreads, 50),
        "chord_spread_p90_ms": _percentile(spreads, 90),
        "chord_spread_wanted_p90_ms": _percentile(wanted_spreads, 90),
    }


def _pedal_lifts(score: Score, played: Score) -> tuple[int, int]:
    """Number of lifts in the score, and how many of them were played."""
    lifts = score.pedal[score.pedal[:, 1] < score.duration, 1]
    waiting = played.pedal[::-1, 1].tolist()
    kept = 0
    # All windows have the same length, so a greedy match is the largest.
    for lift in lifts.tolist():
        while waiting and rounded(waiting[-1] - lift) < -CONSTANTS.pedal:
            waiting.pop()
        if waiting and rounded(waiting[-1] - lift) <= CONSTANTS.pedal:
            waiting.pop()
            kept += 1
    return len(lifts), kept


def _key_time_f1(wanted: Score, heard: Score) -> float | None:
    """F1 of the time that keys are down."""
    one, other = key_seconds(wanted), key_seconds(heard)
    whole = float(np.diff(one).sum() + np.diff(other).sum())
    return _ratio(2 * overlap(one, other), whole)


def _by_voice(wanted: Score, struck: NDArray[np.bool_]) -> dict[str, Any]:
    """Wanted and unmatched notes of each voice."""
    voice = voices(wanted, CONSTANTS.chord)
    made = {}
    for name, number in (("melody", MELODY), ("bass", BASS), ("inner", INNER)):
        notes = int(np.count_nonzero(voice == number))
        lost = int(np.count_nonzero((voice == number) & ~struck))
        made[name] = Voice(notes, lost, _ratio(lost, notes))
    return made


def _correlation(one: NDArray[np.int64], other: NDArray[np.int64]) -> float | None:
    """Pearson's correlation."""
    if not len(one) or not np.ptp(one) or not np.ptp(other):
        return None
    return float(np.corrcoef(one, other)[0, 1])


def _percentiles(seconds: NDArray[np.float64]) -> tuple[float, float, float] | None:
    """5th, 50th and 95th percentile [ms]."""
    if not len(seconds):
        return None
    low, middle, high = (1000 * np.percentile(seconds, (5, 50, 95))).tolist()
    return low, middle, high


def _percentile(seconds: list[Any], share: int) -> float | None:
    """One percentile [ms]."""
    return float(1000 * np.percentile(seconds, share)) if seconds else None


def _ratio(part: float, whole: float) -> float | None:
    """Part / whole; None where the whole is nothing."""
    return float(part / whole) if whole > 0 else None
