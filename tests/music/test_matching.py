"""Matching, key time and voices against the slowest way there is."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import any_score
from pianomime.music import Score
from pianomime.music.key_time import key_seconds, overlap, strikes
from pianomime.music.matching import Candidates
from pianomime.music.voices import BASS, INNER, MELODY, voices

SMALL = any_score.scores(most_notes=5, seconds=0.5)
TOLERANCE = 0.15


def best_by_trying_all(wanted: Score, played: Score) -> tuple[int, float]:
    """Size and least error of the largest one-to-one matching."""
    for size in range(min(len(wanted), len(played)), 0, -1):
        errors = []
        for notes in combinations(range(len(wanted)), size):
            for others in permutations(range(len(played)), size):
                late = np.round(played.onset[list(others)] - wanted.onset[list(notes)], 4)
                same = wanted.key[list(notes)] == played.key[list(others)]
                if same.all() and (abs(late) <= TOLERANCE).all():
                    errors.append(abs(late).sum())
        if errors:
            return size, min(errors)
    return 0, 0.0


@given(SMALL, SMALL, st.integers(0, 3))
@settings(max_examples=60, deadline=None)
def test_the_matching_is_the_largest_and_of_these_the_nearest(
    wanted: Score, played: Score, keys: int
) -> None:
    # On few keys, where notes compete.
    wanted, played = (replace(score, key=score.key % (keys + 1)) for score in (wanted, played))
    size, error = best_by_trying_all(wanted, played)
    near = Candidates.of(wanted, played, TOLERANCE)
    matched = near.nearest()
    assert near.most() == len(matched.late) == size
    assert np.abs(matched.late).sum() == pytest.approx(error)
    assert len(set(matched.wanted)) == len(set(matched.played)) == size
    assert (np.diff(matched.wanted) > 0).all()
    assert (wanted.key[matched.wanted] == played.key[matched.played]).all()


@given(any_score.scores(), any_score.scores())
@settings(max_examples=60, deadline=None)
def test_candidates_are_all_pairs_that_are_near(wanted: Score, played: Score) -> None:
    near = Candidates.of(wanted, played, TOLERANCE)
    late = np.round(played.onset[None] - wanted.onset[:, None], 4)
    right = (abs(late) <= TOLERANCE) & (wanted.key[:, None] == played.key[None])
    assert sorted(zip(near.wanted, near.played, strict=True)) == list(
        zip(*right.nonzero(), strict=True)
    )
    assert (near.late == late[near.wanted, near.played]).all()


def on_raster(score: Score) -> np.ndarray:
    """(88, ticks) Keys that are down, at 1/64 s: times of `any_score` are multiples of it."""
    down = np.zeros((88, 64 * 4), bool)
    for key, onset, offset in zip(score.key, score.onset * 64, score.offset * 64, strict=True):
        down[key, round(onset) : round(offset)] = True
    return down


@given(any_score.scores(), any_score.scores())
@settings(max_examples=80, deadline=None)
def test_key_time_is_that_of_a_raster(one: Score, other: Score) -> None:
    first, second = on_raster(one), on_raster(other)
    assert np.diff(key_seconds(one)).sum() == pytest.approx(first.sum() / 64, abs=1e-6)
    shared = overlap(key_seconds(one), key_seconds(other))
    assert shared == pytest.approx((first & second).sum() / 64, abs=1e-6)


@given(any_score.scores())
@settings(max_examples=60, deadline=None)
def test_strikes_of_a_key_do_not_overlap_and_sound_as_long(score: Score) -> None:
    struck = strikes(score)
    assert (struck.onset == score.onset).all()
    assert (on_raster(struck) == on_raster(score)).all()
    for key in set(struck.key.tolist()):
        mine = struck.key == key
        assert (struck.offset[mine][:-1] <= struck.onset[mine][1:]).all()
    assert (strikes(struck).offset == struck.offset).all()


@given(any_score.scores())
@settings(max_examples=60, deadline=None)
def test_voices_are_those_of_what_sounds(score: Score) -> None:
    window = 1 / 32
    for note, voice in enumerate(voices(score, window)):
        at = score.onset[note]
        together = score.key[(score.onset <= at + window) & (score.offset > at)]
        higher, lower = (together > score.key[note]).any(), (together < score.key[note]).any()
        assert voice == (INNER if higher and lower else BASS if higher else MELODY)
