"""Fusion of notes that are seen with notes that are heard: laws on made-up music."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import made_up_video as made_up
from pianomime.music import Score
from pianomime.video.advice import RETARGET
from pianomime.video.notes.fusion import fuse
from pianomime.video.notes.offset import LATEST_SOUND
from pianomime.video.remarks import on_fused


@pytest.fixture(scope="module")
def played() -> Score:
    """What was played: with touch and pedal, between the frames of pictures."""
    song = made_up.song(20.0)
    draw = np.random.default_rng(0)
    return replace(
        song,
        onset=song.onset + draw.uniform(0, 0.04, len(song)),
        offset=song.offset + 0.04,
        velocity=draw.integers(20, 120, len(song)),
        pedal=np.array([[1.0, 3.0], [5.0, 9.0]]),
    )


def seen_of(played: Score) -> Score:
    """The same in pictures, 20 a second: all as loud, without pedal."""
    onset = np.floor(played.onset * 20 + 0.5) / 20
    return Score(played.key, onset, onset + 0.2, np.full(len(played), 80), title="film")


def later(score: Score, seconds: float) -> Score:
    return replace(
        score,
        onset=score.onset + seconds,
        offset=score.offset + seconds,
        pedal=score.pedal + seconds,
    )


@pytest.mark.parametrize("late", [0.0, 0.2, 1.0, LATEST_SOUND - 0.2, -0.3])
def test_the_sound_says_when_how_loud_and_what_the_pedal_does(played: Score, late: float) -> None:
    fused = fuse(seen_of(played), later(played, late))
    assert (fused.both, fused.only_seen, fused.only_heard) == (len(played), 0, 0)
    assert fused.alike
    # Only the mean of what pictures and sound differ by tells where they belong together.
    assert fused.late == pytest.approx(late, abs=0.03)
    shift = fused.late - late
    np.testing.assert_array_equal(fused.score.key, played.key)
    np.testing.assert_array_equal(fused.score.velocity, played.velocity)
    np.testing.assert_allclose(fused.score.onset, played.onset - shift, atol=1e-9)
    np.testing.assert_allclose(fused.score.pedal, played.pedal - shift, atol=1e-9)
    assert fused.score.title == "film"


def test_light_says_which_keys(played: Score) -> None:
    """Notes that are only heard are left out, notes that are only seen stay, and both are told."""
    ghosts = np.arange(0, len(played), 4)
    unheard = np.arange(1, len(played), 8)
    kept = np.setdiff1d(np.arange(len(played)), unheard)
    heard = Score(
        np.concatenate((played.key[kept], played.key[ghosts] + 36)),
        np.concatenate((played.onset[kept], played.onset[ghosts] + 0.003)),
        np.concatenate((played.offset[kept], played.offset[ghosts])),
        np.concatenate((played.velocity[kept], np.full(len(ghosts), 10))),
    )
    fused = fuse(seen_of(played), heard)
    np.testing.assert_array_equal(np.sort(fused.score.key), np.sort(played.key))
    assert fused.both == len(kept)
    assert fused.only_seen == len(unheard)
    assert fused.only_heard == len(ghosts)
    (line,) = on_fused(fused, RETARGET)
    assert line.text.startswith(f"{len(kept)} of {len(played)} notes are seen and heard; ")
    assert f"{len(unheard)} only seen are kept, {len(ghosts)} only heard are left out" in line.text


def test_a_sound_of_something_else(played: Score) -> None:
    other = replace(played, key=played.key + 1)
    fused = fuse(seen_of(played), other)
    assert not fused.alike
    assert "the sound is of no help" in on_fused(fused, RETARGET)[0].text


def test_nothing_in_common() -> None:
    one = Score(np.array([40]), np.array([1.0]), np.array([2.0]), np.array([80]))
    fused = fuse(one, replace(one, key=np.array([41])))
    np.testing.assert_array_equal(fused.score.onset, one.onset)
    np.testing.assert_array_equal(fused.score.velocity, one.velocity)
    assert (fused.both, fused.only_seen, fused.only_heard, fused.late) == (0, 1, 1, 0.0)


def test_a_lateness_that_is_given(played: Score) -> None:
    assert not fuse(seen_of(played), later(played, 1.0), late=0.0).alike
    assert fuse(seen_of(played), later(played, 1.0), late=1.0).late == 1.0


def test_notes_on_one_key_never_overlap(played: Score) -> None:
    """Also where an onset moves into the note before it."""
    onset = np.arange(1.0, 5.0, 0.25)
    same = Score(np.full(16, 40), onset, onset + 0.25, np.full(16, 80))
    fused = fuse(same, replace(same, onset=onset - 0.04 * (np.arange(16) % 2)))
    assert (fused.score.offset[:-1] <= fused.score.onset[1:]).all()
    assert (fused.score.offset > fused.score.onset).all()
