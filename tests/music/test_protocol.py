"""The `music` protocol against mir_eval, and by hand."""

from __future__ import annotations

import warnings
from dataclasses import asdict, replace

import mir_eval
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pianomime.music import Score
from pianomime.music.key_time import strikes
from pianomime.music.protocol import (
    CONSTANTS,
    PROTOCOL_VERSION,
    Voice,
    music_metrics,
    protocol_digest,
)

SEEDS = st.integers(0, 2**32 - 1)


def score_of(*notes: tuple[float, ...], pedal: list[tuple[float, float]] | None = None) -> Score:
    """Notes as (key, onset, offset) or (key, onset, offset, velocity)."""
    key, onset, offset, velocity = zip(*((*note, 80)[:4] for note in notes), strict=True)
    return Score(
        np.array(key), np.array(onset), np.array(offset), np.array(velocity), np.array(pedal or [])
    )


NOTHING = Score(np.array([]), np.array([]), np.array([]), np.array([]))


def played_twice(seed: int, on_grid: bool = False) -> tuple[Score, Score]:
    """A score, and a playing of it that errs in every way, with many notes close on few keys."""
    draw = np.random.default_rng(seed)

    def grid(times: np.ndarray) -> np.ndarray:
        # Times on a grid often differ by a tolerance itself.
        return np.round(times, 2) if on_grid else times

    count = draw.integers(1, 40)
    key = draw.integers(0, 5, count)
    onset, velocity = draw.uniform(0.3, 3, count), draw.integers(1, 128, count)
    length = draw.uniform(0.01, 0.8, count)
    wanted = Score(key, grid(onset), grid(onset) + grid(length) + 0.01, velocity)
    more = draw.integers(0, 10)
    kept = draw.random(count) > 0.1
    onset = np.append((onset + draw.normal(0, 0.03, count))[kept], draw.uniform(0.3, 3, more))
    length = np.append((length + draw.normal(0, 0.1, count))[kept], draw.uniform(0, 1, more))
    loud = np.clip(velocity + np.rint(draw.normal(0, 15, count)).astype(int), 1, 127)[kept]
    played = Score(
        np.append(key[kept], draw.integers(0, 5, more)),
        grid(onset),
        grid(onset) + np.maximum(grid(length), 0) + 0.01,
        np.append(loud, draw.integers(1, 128, more)),
    )
    return sounded(wanted), sounded(played)


def sounded(score: Score) -> Score:
    """As one piano sounds it, without notes of no length, which mir_eval refuses."""
    score = strikes(score)
    some = score.offset > score.onset
    return Score(*(getattr(score, name)[some] for name in ("key", "onset", "offset", "velocity")))


def for_mir_eval(score: Score) -> tuple[np.ndarray, np.ndarray]:
    return np.stack([score.onset, score.offset], axis=1), 440.0 * 2 ** ((score.key - 48) / 12)


@given(SEEDS, st.booleans())
@settings(max_examples=80, deadline=None)
def test_notes_are_scored_as_by_mir_eval(seed: int, on_grid: bool) -> None:
    wanted, played = played_twice(seed, on_grid)
    metrics = asdict(music_metrics(wanted, played))
    for tolerance in (0.05, 0.025, 0.01):
        for what, ratio in (("note", None), ("note_offset", 0.2)):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # nothing played
                theirs = mir_eval.transcription.precision_recall_f1_overlap(
                    *for_mir_eval(wanted),
                    *for_mir_eval(played),
                    onset_tolerance=tolerance,
                    offset_ratio=ratio,
                )[:3]
            ours = [
                metrics[f"{what}_{part}_{1000 * tolerance:.0f}"]
                for part in ("precision", "recall", "f1")
            ]
            assert ours == pytest.approx(theirs)


@given(SEEDS)
@settings(max_examples=60, deadline=None)
def test_velocities_are_scored_as_by_mir_eval(seed: int) -> None:
    draw = np.random.default_rng(seed)
    # One after the other on each key: then there is one matching alone.
    key = np.repeat(np.arange(6), 5)
    onset = 0.3 + np.tile(np.arange(5) * 0.4, 6) + draw.uniform(0, 0.1, 30)
    velocity = draw.integers(1, 128, 30) if seed % 4 else np.full(30, 64)
    wanted = Score(key, onset, onset + 0.1, velocity)
    late = draw.normal(0, 0.04, 30)
    loud = np.clip(velocity * draw.uniform(0.2, 2) + draw.normal(0, 12, 30), 1, 127).astype(int)
    played = Score(key, onset + late, onset + late + 0.1, loud)
    theirs = mir_eval.transcription_velocity.precision_recall_f1_overlap(
        *for_mir_eval(wanted), wanted.velocity,
        *for_mir_eval(played), played.velocity,
        offset_ratio=None,
    )[2]  # fmt: skip
    ours = music_metrics(wanted, played)
    assert ours.velocity_f1_rescaled == pytest.approx(theirs)
    right = np.count_nonzero((np.round(abs(late), 4) <= 0.05) & (abs(loud - velocity) <= 8))
    assert ours.velocity_f1 == pytest.approx(2 * right / 60)


def test_of_two_matchings_velocity_f1_takes_the_one_with_more_velocities_right() -> None:
    wanted = score_of((40, 1.00, 1.02, 30), (40, 1.04, 1.06, 90))
    played = score_of((40, 1.01, 1.02, 90), (40, 1.03, 1.04, 30))
    assert music_metrics(wanted, played).velocity_f1 == 1.0
    assert music_metrics(wanted, replace(played, velocity=[39, 81])).velocity_f1 == 0.0
    assert music_metrics(wanted, replace(played, velocity=[38, 82])).velocity_f1 == 1.0


@given(SEEDS, st.booleans())
@settings(max_examples=40, deadline=None)
def test_a_score_played_as_it_is_written_is_perfect(seed: int, on_grid: bool) -> None:
    wanted, _ = played_twice(seed, on_grid)
    wanted = replace(wanted, pedal=np.array([[0.1, 0.4], [0.6, 0.9]]))
    metrics = asdict(music_metrics(wanted, wanted))
    perfect = {name: value for name, value in metrics.items() if "f1" in name or "precis" in name}
    assert list(perfect.values()) == pytest.approx([1.0] * len(perfect))
    assert metrics["velocity_correlation"] in (None, pytest.approx(1.0))
    assert metrics["onset_error_ms"] == metrics["offset_error_ms"] == (0, 0, 0)
    assert (metrics["phantoms"], metrics["phantoms_per_minute"], metrics["never_struck"]) == (
        0,
    ) * 3
    assert metrics["restruck"] in (None, 1.0)
    assert metrics["pedal_lifts_kept"] in (None, 1.0)
    assert metrics["chord_spread_p90_ms"] == metrics["chord_spread_wanted_p90_ms"]


def test_notes_that_overlap_on_a_key_are_played_perfectly_by_themselves() -> None:
    score = score_of((40, 0.0, 2.0), (40, 1.0, 1.5), (40, 1.0, 3.0), (41, 0.5, 0.5))
    metrics = music_metrics(score, score)
    assert metrics.note_offset_f1_10 == 1.0
    assert metrics.key_time_f1 == pytest.approx(1.0)
    # The key is down for 3 s whatever the voices are: what is heard of it is two strikes.
    heard = score_of((40, 0.0, 1.0), (40, 1.0, 3.0))
    assert music_metrics(score, heard).key_time_f1 == pytest.approx(1.0)


def test_nothing_to_measure_is_none_and_nothing_played_is_zero() -> None:
    silent = music_metrics(NOTHING, NOTHING)
    numbers = {name: value for name, value in asdict(silent).items() if value is not None}
    voices = ("melody", "bass", "inner")
    counts = ("notes", "strikes", "phantoms", "repeats", "chords", "pedal_lifts")
    assert numbers == {
        **dict.fromkeys(counts, 0),
        **dict.fromkeys(voices, asdict(Voice(0, 0, None))),
    }
    missed = music_metrics(score_of((40, 0.0, 1.0)), NOTHING)
    assert missed.note_precision_50 == missed.note_recall_50 == missed.note_f1_50 == 0.0
    assert missed.velocity_f1 == missed.velocity_f1_rescaled == missed.key_time_f1 == 0.0
    assert missed.onset_error_ms is missed.offset_error_ms is missed.velocity_correlation is None
    assert missed.never_struck == 1.0
    unasked = music_metrics(NOTHING, score_of((40, 0.0, 1.0)))
    assert unasked.note_recall_50 == unasked.note_f1_50 == 0.0
    assert unasked.phantoms == 1
    assert unasked.phantoms_per_minute is unasked.never_struck is None


def test_lag_counts() -> None:
    notes = [(30 + n, 0.5 * n, 0.5 * n + 0.3) for n in range(10)]
    wanted = score_of(*notes)
    late = score_of(*((key, on + 0.03, off + 0.03) for key, on, off in notes))
    metrics = music_metrics(wanted, late)
    assert (metrics.note_f1_50, metrics.note_f1_25, metrics.note_f1_10) == (1.0, 0.0, 0.0)
    assert metrics.onset_error_ms == pytest.approx((30, 30, 30))
    assert metrics.offset_error_ms == pytest.approx((30, 30, 30))


def test_onset_errors_by_hand() -> None:
    errors = [-0.020, 0.000, 0.010, 0.040, 0.140]
    wanted = score_of(*((40 + n, 1.0 + n, 1.5 + n) for n in range(5)))
    played = score_of(*((40 + n, 1.0 + n + late, 1.6 + n) for n, late in enumerate(errors)))
    metrics = music_metrics(wanted, played)
    assert metrics.onset_error_ms == pytest.approx(np.percentile(errors, (5, 50, 95)) * 1000)
    assert metrics.offset_error_ms == pytest.approx((100, 100, 100))


def test_strikes_that_nobody_wanted_and_notes_without_a_strike() -> None:
    wanted = score_of((40, 1.0, 1.2), (42, 2.0, 2.2), (44, 3.0, 20.0))
    played = score_of(
        (40, 1.1499, 1.2),  # badly timed, but that note
        (40, 1.16, 1.3),  # a second strike of it
        (43, 2.0, 2.2),  # the neighbour
        (44, 3.1502, 20.0),  # another note by now
    )
    metrics = music_metrics(wanted, played)
    assert metrics.phantoms == 3
    assert metrics.phantoms_per_minute == pytest.approx(3 * 60 / 20)
    assert metrics.never_struck == pytest.approx(2 / 3)
    assert metrics.strikes == 4


def test_a_strike_that_is_right_is_no_phantom_whatever_was_near_before_it() -> None:
    # Each strike is near both notes: two pairs rather than one that errs less.
    wanted = score_of((40, 1.0, 1.05), (40, 1.1, 1.15))
    played = score_of((40, 1.1, 1.12), (40, 1.2, 1.22))
    metrics = music_metrics(wanted, played)
    assert (metrics.phantoms, metrics.never_struck) == (0, 0.0)
    assert metrics.onset_error_ms == pytest.approx((100, 100, 100))


def test_repeated_notes() -> None:
    wanted = score_of(
        (40, 0.0, 0.4), (40, 0.5, 0.9),  # repeated after 0.1 s
        (40, 1.4, 1.5),  # after 0.5 s: another note
        (41, 0.0, 2.0), (41, 1.0, 2.0),  # repeated while it sounds
        (42, 0.0, 0.1), (42, 0.2, 0.3),  # repeated after 0.1 s
    )  # fmt: skip
    held = score_of(
        (40, 0.0, 0.9), (40, 1.4, 1.5), (41, 0.0, 0.98), (41, 1.01, 2.0), (42, 0.21, 0.3)
    )
    metrics = music_metrics(wanted, held)
    assert metrics.repeats == 3
    assert metrics.restruck == pytest.approx(2 / 3)


def test_chords() -> None:
    wanted = score_of(
        (40, 1.0, 2.0), (44, 1.0, 2.0), (47, 1.03, 2.0), (50, 1.031, 2.0),  # three, and one alone
        (40, 3.0, 4.0), (44, 3.02, 4.0),
        (60, 5.0, 6.0), (64, 5.0, 6.0),
    )  # fmt: skip
    played = score_of(
        (40, 1.01, 2.0), (44, 1.0, 2.0), (47, 1.06, 2.0), (50, 1.2, 2.0),
        (40, 3.0, 4.0), (44, 3.01, 4.0),
        (60, 5.0, 6.0),  # the other is missing
    )  # fmt: skip
    metrics = music_metrics(wanted, played)
    assert metrics.chords == 2
    assert metrics.chord_spread_p50_ms == pytest.approx(np.percentile([60, 10], 50))
    assert metrics.chord_spread_p90_ms == pytest.approx(np.percentile([60, 10], 90))
    assert metrics.chord_spread_wanted_p90_ms == pytest.approx(np.percentile([30, 20], 90))


def test_pedal_lifts() -> None:
    # The last lift is with the end of the last note: nobody hears it.
    score = score_of((40, 0.0, 5.0), pedal=[(0, 1.0), (1.003, 2.0), (2.003, 3.0), (3.5, 5.0)])
    played = score_of((40, 0.0, 5.0), pedal=[(0, 1.05), (1.2, 2.0501), (2.9, 4.0)])
    metrics = music_metrics(score, played)
    assert metrics.pedal_lifts == 3
    assert metrics.pedal_lifts_kept == pytest.approx(1 / 3)
    # One lift is not two.
    twice = score_of((40, 0.0, 5.0), pedal=[(0, 1.0), (1.01, 1.04)])
    once = score_of((40, 0.0, 5.0), pedal=[(0, 1.02)])
    assert music_metrics(twice, once).pedal_lifts_kept == 0.5
    assert music_metrics(twice, replace(once, pedal=[])).pedal_lifts_kept == 0.0


def test_key_time_is_exact() -> None:
    wanted = score_of((40, 0.0, 1.0), (41, 0.0, 1.0))
    played = score_of((40, 0.25, 1.5), (42, 0.0, 0.5))
    assert music_metrics(wanted, played).key_time_f1 == pytest.approx(2 * 0.75 / (2.0 + 1.75))


def test_what_is_left_out_is_counted_by_voice() -> None:
    chord = [(36, 1.0, 2.0), (48, 1.0, 2.0), (52, 1.0, 2.0), (60, 1.0, 2.0)]
    wanted = score_of(*chord, (70, 3.0, 4.0))
    metrics = music_metrics(wanted, score_of(chord[1], chord[3]))
    assert metrics.melody == Voice(2, 1, 0.5)
    assert metrics.bass == Voice(1, 1, 1.0)
    assert metrics.inner == Voice(2, 1, 0.5)


def test_velocity_correlation() -> None:
    wanted = score_of(*((40 + n, float(n), n + 0.5, 20 * (n + 1)) for n in range(5)))
    softer = replace(wanted, velocity=wanted.velocity // 2)
    assert music_metrics(wanted, softer).velocity_correlation == pytest.approx(1.0)
    assert music_metrics(wanted, softer).velocity_f1 == pytest.approx(0.0)
    backward = replace(wanted, velocity=wanted.velocity[::-1])
    assert music_metrics(wanted, backward).velocity_correlation == pytest.approx(-1.0)
    flat = replace(wanted, velocity=np.full(5, 64))
    assert music_metrics(wanted, flat).velocity_correlation is None


def test_the_digest_tells_constants_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    mine = protocol_digest()
    assert len(mine) == 16
    monkeypatch.setattr("pianomime.music.protocol.CONSTANTS", replace(CONSTANTS, match=0.2))
    assert protocol_digest() != mine
    monkeypatch.undo()
    monkeypatch.setattr("pianomime.music.protocol.PROTOCOL_VERSION", PROTOCOL_VERSION + 1)
    assert protocol_digest() != mine


def test_constants_change_with_the_version_only() -> None:
    """Whoever changes a constant raises `PROTOCOL_VERSION`, and writes the new digest here."""
    assert {1: "a9fbbe931982f705"}[PROTOCOL_VERSION] == protocol_digest()
