"""Strikes of a score: their laws, and single ones by hand."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray

from any_score import scores
from pianomime.keyboard import FRAME_SECONDS
from pianomime.music import Score
from pianomime.plan import ZeroShotPlanner
from pianomime.plan.fingering import Fingering, find_fingering
from pianomime.plan.fingering_cost import FingeringConfig
from pianomime.plan.strikes import Strikes, strikes_of

LEFT, RIGHT = 0, 1
THUMB, INDEX, LITTLE = 0, 1, 4
KEY_IS_UP = 0.03
"""[s] Least time between letting go of a key and striking it again that two far notes leave."""
EDGE = 0.005
"""[s] By which strikes may keep away from the ends of frames: nobody hears so little."""
QUICK = FingeringConfig(beam=4)


def by_hand(score: Score, finger: int = INDEX, hand: int = RIGHT) -> Fingering:
    """All notes to one finger, in their own frames."""
    frames = score.note_frames()
    return Fingering(
        np.full(len(score), hand, np.int8),
        np.full(len(score), finger, np.int8),
        frames[:, 0].copy(),
        frames[:, 1].copy(),
    )


def notes(key: list[int], onset: list[float], lasts: float | list[float] = 0.2) -> Score:
    begin = np.array(onset)
    return Score(np.array(key), begin, begin + lasts, np.arange(40, 40 + len(key)))


def of_note(strikes: Strikes) -> dict[int, int]:
    """Index of the strike of each note."""
    return {note: index for index, note in enumerate(strikes.note.tolist())}


@settings(max_examples=60, deadline=None)
@given(scores())
def test_laws(score: Score) -> None:
    fingering = find_fingering(score, QUICK)
    strikes = strikes_of(score, fingering)
    played = (fingering.hand >= 0) & (fingering.stop > fingering.start)
    # Each note that is played has one strike, and no other has any.
    np.testing.assert_array_equal(np.sort(strikes.note), np.flatnonzero(played))
    for name in ("hand", "finger"):
        np.testing.assert_array_equal(
            getattr(strikes, name), getattr(fingering, name)[strikes.note]
        )
    np.testing.assert_array_equal(strikes.key, score.key[strikes.note])
    np.testing.assert_array_equal(strikes.velocity, score.velocity[strikes.note])
    assert (np.diff(strikes.onset) >= 0).all()
    assert (strikes.release > strikes.onset).all()
    # Late by whole frames where the hand is, and not else.
    waits = (fingering.start - score.note_frames()[:, 0])[strikes.note] * FRAME_SECONDS
    wanted = score.onset[strikes.note] + waits
    np.testing.assert_allclose(strikes.onset, wanted, rtol=0, atol=EDGE + 1e-9)


@settings(max_examples=60, deadline=None)
@given(scores())
def test_a_key_is_let_go_before_it_is_struck_again(score: Score) -> None:
    strikes = strikes_of(score, find_fingering(score, QUICK))
    for key in np.unique(strikes.key):
        mine = strikes.key == key
        onset, release = strikes.onset[mine], strikes.release[mine]
        apart = np.diff(onset)
        # Closer ones cannot be two strikes of one key.
        possible = apart > KEY_IS_UP
        assert (release[:-1][possible] <= onset[1:][possible]).all()
        far = apart > 0.15
        assert (release[:-1][far] <= onset[1:][far] - 0.06).all()


def test_a_note_is_struck_at_its_own_time_and_let_go_after_its_last_frame() -> None:
    score = notes([39, 41], [0.137, 0.361], lasts=[0.2, 0.31])
    strikes = strikes_of(score, by_hand(score))
    np.testing.assert_array_equal(strikes.onset, [0.137, 0.361])
    # Their last frames end at 0.35 s and 0.7 s.
    assert (strikes.release >= [0.35, 0.7]).all()
    assert (strikes.release < [0.35 + 0.02, 0.7 + 0.02]).all()


def test_what_is_cut_is_let_go_at_once_and_what_is_late_is_struck_later() -> None:
    score = notes([39, 41], [0.137, 0.361], lasts=0.3)
    fingering = by_hand(score)
    fingering.stop[0], fingering.start[1] = 6, 9
    strikes = strikes_of(score, fingering)
    np.testing.assert_allclose(strikes.onset, [0.137, 0.361 + 2 * FRAME_SECONDS])
    assert strikes.release[0] == pytest.approx(6 * FRAME_SECONDS)


def test_notes_that_nobody_plays_are_not_struck() -> None:
    score = notes([39, 41, 43], [0.1, 0.4, 0.7])
    fingering = by_hand(score)
    fingering.hand[0] = -1
    fingering.stop[1] = fingering.start[1]
    np.testing.assert_array_equal(strikes_of(score, fingering).note, [2])


def test_a_late_note_comes_after_those_that_overtake_it() -> None:
    score = notes([39, 41], [0.11, 0.16])
    fingering = by_hand(score)
    fingering.start[0] = 5
    strikes = strikes_of(score, fingering)
    np.testing.assert_array_equal(strikes.note, [1, 0])
    np.testing.assert_array_equal(strikes.key, [41, 39])
    np.testing.assert_array_equal(strikes.velocity, [41, 40])


def test_a_repeated_note_is_let_go_in_time() -> None:
    """Held until it sounds again, the key would have to be up at once."""
    score = notes([39, 39, 41], [0.12, 0.42, 0.42], lasts=0.3)
    strikes = strikes_of(score, by_hand(score))
    np.testing.assert_allclose(strikes.onset, [0.12, 0.42, 0.42])
    assert strikes.release[of_note(strikes)[0]] < 0.42 - 0.06
    # So quick that there is no time for both: it must still be struck.
    score = notes([39, 39], [0.12, 0.22], lasts=0.1)
    strikes = strikes_of(score, by_hand(score))
    np.testing.assert_allclose(strikes.onset, [0.12, 0.22])
    assert 0.12 < strikes.release[0] < 0.22


def test_the_ear_follows_the_outermost_notes_of_a_chord() -> None:
    score = notes([27, 34, 39, 43], [0.1, 0.1, 0.12, 0.11], lasts=0.4)
    strikes = strikes_of(score, by_hand(score))
    outer = dict(zip(strikes.key.tolist(), strikes.outer.tolist(), strict=True))
    assert outer == {27: True, 34: False, 39: False, 43: True}


def test_the_zero_shot_planner_says_when_keys_are_struck() -> None:
    score = notes([39, 43, 46], [0.113, 0.113, 0.131], lasts=0.4)
    plan = ZeroShotPlanner().plan(score)
    assert plan.strikes is not None
    np.testing.assert_array_equal(plan.strikes.onset, [0.113, 0.113, 0.131])
    np.testing.assert_array_equal(plan.strikes.hand, plan.note_hand)
    np.testing.assert_array_equal(plan.strikes.finger, plan.note_finger)
    for index in range(3):
        frame = int((plan.strikes.onset[index] + FRAME_SECONDS) / FRAME_SECONDS)
        pressed = plan.finger_key[frame, plan.strikes.hand[index], plan.strikes.finger[index]]
        assert pressed == plan.strikes.key[index]


def test_no_notes_no_strikes() -> None:
    nothing = Score(*np.zeros((4, 0)))
    strikes = strikes_of(nothing, find_fingering(nothing))
    assert len(strikes) == 0
    assert {getattr(strikes, each.name).shape for each in fields(strikes)} == {(0,)}


@pytest.fixture
def two() -> Strikes:
    score = notes([39, 41], [0.1, 0.4])
    return strikes_of(score, by_hand(score))


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("velocity", np.array([64]), "as many of everything"),
        ("onset", np.array([0.4, 0.1]), "order of their onsets"),
        ("release", np.array([0.1, 0.6]), "let go after they sound"),
        ("release", np.array([0.3, np.nan]), "let go after they sound"),
    ],
)
def test_strikes_check_themselves(
    two: Strikes, name: str, value: NDArray[np.float64], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        replace(two, **{name: value})
