"""The offset of a sound by the hands alone: where keys do not even seem to move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import made_up_video as made_up
from pianomime.music import Score
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.notes.agreement import agreement
from pianomime.video.notes.offset import LATE_SOUND, LATEST_SOUND, Offset, _middle, estimate_offset
from pianomime.video.remarks import on_sound

SECONDS = 16.0


@pytest.fixture(scope="module")
def score() -> Score:
    """Notes for which both hands move to and fro on the keyboard."""
    onset = np.arange(0.5, SECONDS - 1.0, 0.25)
    draw = np.random.default_rng(0)
    right = 60 + np.round(14 * np.sin(onset)).astype(int) + draw.integers(-3, 4, len(onset))
    left = 22 + np.round(14 * np.cos(0.7 * onset)).astype(int) + draw.integers(-3, 4, len(onset))
    key, begin = np.concatenate((right, left)), np.tile(onset, 2)
    return Score(key, begin, begin + 0.2, np.full(len(key), 80))


@pytest.fixture(scope="module")
def tracks(score: Score) -> HandTracks:
    points = made_up.plan_of(score).fingertips[..., :2].astype(np.float32)
    found = np.ones(points.shape[:2], bool)
    return HandTracks(points, found, np.zeros(points.shape[:3], bool), 0, 0)


def offset_of(heard: Score, tracks: HandTracks, missing: NDArray[np.bool_] | None = None) -> Offset:
    missing = np.zeros(len(tracks), bool) if missing is None else missing
    with LightRecord.of(np.full((len(tracks), 3, 88, 3), 90, np.uint8)) as dark:
        return estimate_offset(heard, tracks, dark, missing, None, LATE_SOUND, LATEST_SOUND)


def agreed(heard: Score, offset: Offset, tracks: HandTracks) -> float:
    """How well the notes agree with the fingers, beyond chance, where they are placed."""
    begins = max(0.0, -offset.seconds)
    timed = heard.clip(begins, begins + len(tracks) / 20)
    shown = np.zeros(len(tracks), bool)
    return float(agreement(timed, tracks.points, shown).beyond_chance)


@pytest.mark.parametrize("late", [0.0, 0.4, 1.0, 2.5])
def test_how_late_a_sound_is(score: Score, tracks: HandTracks, late: float) -> None:
    heard = replace(score, onset=score.onset + late, offset=score.offset + late)
    offset = offset_of(heard, tracks)
    assert agreed(heard, offset, tracks) > 0.7
    assert offset.seconds == pytest.approx(-late, abs=0.1)
    said = on_sound(heard, offset, len(tracks) / 20)
    assert any("later than the pictures" in remark.text for remark in said) == (late > LATE_SOUND)


def test_it_is_never_later_than_it_may_be(score: Score, tracks: HandTracks) -> None:
    heard = replace(score, onset=score.onset + 6.0, offset=score.offset + 6.0)
    assert abs(offset_of(heard, tracks).seconds) <= LATEST_SOUND + 0.05


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_slow_and_fast_motion_are_doubted(score: Score, tracks: HandTracks, speed: float) -> None:
    heard = replace(score, onset=score.onset * speed, offset=score.offset * speed)
    assert agreed(heard, offset_of(heard, tracks), tracks) < 0.4


def test_notes_during_titles_prove_nothing(score: Score, tracks: HandTracks) -> None:
    missing = np.zeros(len(tracks), bool)
    missing[: len(tracks) // 2] = True
    away = np.where(missing[:, None, None, None], np.float32(9.0), tracks.points)
    titles = replace(tracks, points=away, found=tracks.found & ~missing[:, None])
    all_shown = np.zeros(len(tracks), bool)
    assert offset_of(score, titles).touched < 0.7
    found = offset_of(score, titles, missing)
    assert found.touched > 0.9
    assert abs(found.seconds) < 0.1
    assert agreement(score, away, all_shown).share < 0.7
    agreed = agreement(score, away, missing)
    assert agreed.share > 0.9
    assert agreed.beyond_chance > 0.5


@pytest.mark.parametrize("best", [3, 4, 5, 6])
def test_of_lags_that_fit_alike_the_middle_is_taken(best: int) -> None:
    """As where fingers rest on their keys before and after; the best by a hair is chance."""
    fit = np.array([0.1, 0.2, 0.7, 1.0, 1.0, 1.0, 1.0, 0.8, 0.1])
    fit[best] += 0.008
    assert _middle(fit, best, fit > 0.9) == pytest.approx(4.5)
    # What differs by more is told apart, to less than a frame.
    assert _middle(fit, best, fit == fit.max()) == pytest.approx(best, abs=0.51)


def test_a_plateau_may_reach_the_end() -> None:
    assert _middle(np.ones(5), 2, np.ones(5, bool)) == pytest.approx(2.0)
    assert _middle(np.array([1.0, 1.0, 0.0]), 0, np.array([True, True, False])) == pytest.approx(
        0.5
    )


def test_music_that_is_hardly_in_the_video_stays_where_it_is(tracks: HandTracks) -> None:
    late = Score([40, 41], [900.0, 1000.0], [900.5, 1000.5], [80, 80])
    assert offset_of(late, tracks).seconds == 0.0
