"""Rehearsal: strikes are corrected by what was heard of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heard import listen, notes, plan_of, play, scale
from pianomime.errors import InputError
from pianomime.plan.strikes import Strikes
from pianomime.track import KeystrokeTracker, RehearsalConfig, RehearsedTracker
from pianomime.track.heard import Strike
from pianomime.track.rehearsal import corrected
from pianomime.track.strokes import Corrections

PLAIN = KeystrokeTracker()
ALL = RehearsalConfig(time=1.0, touch=1.0)
SPEED = 0.3
KEY, OTHER = 40, 44


def strikes_at(key: list[int], onset: list[float]) -> Strikes:
    count = len(key)
    begin = np.array(onset)
    return Strikes(
        note=np.arange(count),
        hand=np.ones(count, int),
        finger=np.ones(count, int),
        key=np.array(key),
        onset=begin,
        release=begin + 0.2,
        velocity=np.full(count, 64),
        outer=np.ones(count, bool),
    )


TWO = strikes_at([KEY, OTHER], [0.5, 0.7])


def after(
    heard: list[Strike],
    config: RehearsalConfig = ALL,
    strikes: Strikes = TWO,
    before: Corrections | None = None,
) -> Corrections:
    before = before or Corrections.none(len(strikes))
    return corrected(before, strikes, np.full(len(strikes), SPEED), heard, config)


def test_what_is_late_is_aimed_at_earlier_and_what_is_early_later() -> None:
    found = after([Strike(KEY, 0.52, SPEED), Strike(OTHER, 0.69, SPEED)])
    np.testing.assert_allclose(found.advance, [0.02, -0.01])
    np.testing.assert_allclose(found.speed, 1.0)


def test_what_is_soft_is_aimed_at_faster_and_what_is_loud_slower() -> None:
    found = after([Strike(KEY, 0.5, SPEED / 1.25), Strike(OTHER, 0.7, 1.25 * SPEED)])
    np.testing.assert_allclose(found.speed, [1.25, 0.8])
    np.testing.assert_allclose(found.advance, 0.0, atol=1e-12)


def test_a_share_of_the_error_is_corrected() -> None:
    heard = [Strike(KEY, 0.52, SPEED / 1.5)]
    found = after(heard, RehearsalConfig(time=0.5, touch=0.25))
    np.testing.assert_allclose(found.advance, [0.01, 0.0])
    np.testing.assert_allclose(found.speed, [1.5**0.25, 1.0])


def test_corrections_add_up() -> None:
    before = Corrections(np.array([0.01, 0.02]), np.array([1.1, 0.9]))
    kept = before.advance.copy(), before.speed.copy()
    found = after([Strike(KEY, 0.51, SPEED / 1.2)], before=before)
    np.testing.assert_allclose(found.advance, [0.02, 0.02])
    np.testing.assert_allclose(found.speed, [1.1 * 1.2, 0.9])
    np.testing.assert_array_equal(before.advance, kept[0])
    np.testing.assert_array_equal(before.speed, kept[1])


def test_what_is_not_heard_stays_as_it_is() -> None:
    before = Corrections(np.array([0.01, -0.02]), np.array([1.1, 0.9]))
    for heard in ([], [Strike(60, 0.5, 1.0)], [Strike(KEY, 0.5 + 0.16, 1.0)]):
        found = after(heard, before=before)
        np.testing.assert_array_equal(found.advance, before.advance)
        np.testing.assert_array_equal(found.speed, before.speed)


def test_corrections_are_bounded() -> None:
    config = replace(ALL, most=0.03, slowest=0.5, fastest=1.5)
    found = after([Strike(KEY, 0.6, 0.05), Strike(OTHER, 0.6, 3.0)], config)
    np.testing.assert_allclose(found.advance, [0.03, -0.03])
    np.testing.assert_allclose(found.speed, [1.5, 0.5])


def test_keys_that_barely_move_are_not_corrected_without_end() -> None:
    config = replace(ALL, fastest=100.0)
    slow, still = (after([Strike(KEY, 0.5, speed)], config).speed[0] for speed in (0.01, 0.0))
    assert slow == still
    assert 1 < slow < 100


def test_each_repetition_has_its_own_strike() -> None:
    strikes = strikes_at([KEY, KEY], [0.5, 0.7])
    heard = [Strike(KEY, 0.53, SPEED), Strike(KEY, 0.69, SPEED)]
    for playing in (heard, heard[::-1]):
        np.testing.assert_allclose(after(playing, strikes=strikes).advance, [0.03, -0.01])
    # The nearest of several; nothing is corrected by a strike twice.
    np.testing.assert_allclose(
        after([*heard, Strike(KEY, 0.42, SPEED)], strikes=strikes).advance, [0.03, -0.01]
    )
    quick = strikes_at([KEY, KEY], [0.5, 0.6])
    np.testing.assert_allclose(after(heard[:1], strikes=quick).advance, [0.03, 0.0])


def test_a_lag_is_rehearsed_away() -> None:
    """A made-up instrument: all sounds late, and softer than it is aimed at."""
    corrections, errors = Corrections.none(2), []
    for _ in range(6):
        times = TWO.onset - corrections.advance + 0.03
        speeds = SPEED * corrections.speed * 0.8
        errors.append([np.abs(times - TWO.onset).max(), np.abs(np.log(speeds / SPEED)).max()])
        heard = [Strike(*row) for row in zip(TWO.key, times, speeds, strict=True)]
        corrections = after(heard, RehearsalConfig(), before=corrections)
    ratio = np.array(errors[1:]) / np.array(errors[:-1])
    np.testing.assert_allclose(ratio, 0.3, rtol=1e-6)


def test_rehearsing_makes_time_and_touch_more_exact() -> None:
    score = scale(27, velocity=np.where(np.arange(14) % 2, 90, 60))
    plan = plan_of(score)
    late, touch = [], []
    for passes in (0, 2):
        heard = listen(RehearsedTracker(PLAIN, RehearsalConfig(passes=passes)), plan, score)
        assert heard.missed == 0
        late.append(np.abs(heard.late).mean())
        touch.append(np.abs(heard.velocity - score.velocity).mean())
    assert late[1] < 0.6 * late[0]
    assert touch[1] < 0.8 * touch[0]


@pytest.mark.parametrize("part", ["time", "touch"])
def test_time_and_touch_are_rehearsed_apart(part: str) -> None:
    plan = plan_of(scale().clip(0, 1.2))
    config = replace(RehearsalConfig(passes=1), **{part: 0.0})
    found = RehearsedTracker(PLAIN, config).start(plan).corrections
    assert (found.advance == 0).all() == (part == "time")
    assert (found.speed == 1).all() == (part == "touch")


def test_no_pass_is_the_tracker_alone_and_passes_are_the_same_again() -> None:
    plan = plan_of(notes([39, 43, 46, 44], [0.1, 0.25, 0.25, 0.43]))
    alone, _ = play(PLAIN.start(plan))
    nothing, _ = play(RehearsedTracker(PLAIN, RehearsalConfig(passes=0)).start(plan))
    np.testing.assert_array_equal(alone, nothing)
    rehearsed = RehearsedTracker(PLAIN)
    once, again = (play(rehearsed.start(plan))[0] for _ in range(2))
    np.testing.assert_array_equal(once, again)
    assert not np.array_equal(once, alone)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"passes": -1}, "passes must be 0 or more"),
        ({"passes": 1.5}, "passes must be a whole number"),
        ({"match": 0.0}, "match must be more than 0"),
        ({"slowest": 0.0}, "slowest must be more than 0"),
        ({"slowest": 1.2}, "slowest must be 0 to 1"),
        ({"fastest": 0.9}, "fastest must be 1 or more"),
        ({"time": -0.1}, "time must be 0 or more"),
        ({"touch": np.nan}, "touch must be 0 or more"),
        ({"most": np.inf}, "most must be 0 or more"),
    ],
)
def test_settings_that_cannot_be_are_refused(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        RehearsalConfig(**wrong)
