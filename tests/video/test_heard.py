"""Notes that are heard, checked against hands of which everything is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import made_up_video as made_up
from pianomime.music import Score
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.notes.heard import check_heard
from pianomime.video.remarks import on_heard


@pytest.fixture(scope="module")
def played() -> Score:
    return made_up.song(8.0)


@pytest.fixture(scope="module")
def tracks(played: Score) -> HandTracks:
    points = made_up.plan_of(played).fingertips[..., :2].astype(np.float32)
    return HandTracks(
        points,
        np.ones(points.shape[:2], bool),
        np.zeros(points.shape[:3], bool),
        0,
        0,
    )


def with_notes(score: Score, key: list[int], onset: list[float], velocity: int) -> Score:
    return Score(
        np.concatenate((score.key, key)),
        np.concatenate((score.onset, onset)),
        np.concatenate((score.offset, np.add(onset, 0.2))),
        np.concatenate((score.velocity, np.full(len(key), velocity))),
    )


def test_what_hands_play_is_not_doubted(played: Score, tracks: HandTracks) -> None:
    checked = check_heard(played, tracks)
    assert (checked.doubted, checked.left_out) == (0, 0)
    np.testing.assert_array_equal(checked.score.onset, played.onset)
    assert on_heard(checked) == []


@pytest.mark.parametrize("up", [12, 19, 24])
def test_a_harmonic_that_no_finger_is_near_is_left_out(
    played: Score, tracks: HandTracks, up: int
) -> None:
    highest = int(np.argmax(played.key))
    key, onset = int(played.key[highest]) + up, float(played.onset[highest])
    checked = check_heard(with_notes(played, [key], [onset + 0.01], 60), tracks)
    assert (checked.doubted, checked.left_out) == (0, 1)
    np.testing.assert_array_equal(checked.score.key, played.key)
    assert "1 notes that are heard are left out" in on_heard(checked)[0].text


@pytest.mark.parametrize(
    ("up", "later", "velocity"),
    [(12, 0.01, 100), (12, 0.12, 60), (14, 0.01, 60)],
    ids=["louder", "later", "no harmonic"],
)
def test_another_one_is_kept_and_counted(
    played: Score, tracks: HandTracks, up: int, later: float, velocity: int
) -> None:
    highest = int(np.argmax(played.key))
    key, onset = int(played.key[highest]) + up, float(played.onset[highest])
    heard = with_notes(played, [key], [onset + later], velocity)
    checked = check_heard(heard, tracks)
    assert (checked.doubted, checked.left_out) == (1, 0)
    assert len(checked.score) == len(heard)
    assert (
        f"1 of {len(heard)} notes that are heard have no finger near" in on_heard(checked)[0].text
    )


def test_where_a_hand_is_hidden_nothing_is_doubted(played: Score, tracks: HandTracks) -> None:
    heard = with_notes(played, [80, 80], [2.0, 5.0], 60)
    for hidden in ([0], [1], [0, 1]):
        found = tracks.found.copy()
        found[80:, hidden] = False
        checked = check_heard(heard, replace(tracks, found=found))
        assert (checked.doubted, checked.left_out) == (1, 0)
