"""The keystroke tracker: notes at their own times, with touch, and what its controllers promise."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from listening import Heard, listen, notes, plan_of, play, scale
from pianomime import load_player
from pianomime.cli import main
from pianomime.errors import InputError
from pianomime.keyboard import FRAME_SECONDS
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.track import (
    KeystrokeConfig,
    KeystrokeTracker,
    RehearsedTracker,
    controls_per_frame,
)
from pianomime.track.strokes import StrokeConfig
from pianomime.world import World

FRAMES = 8
PLAIN = KeystrokeTracker()


def floored(plan: FingertipPlan) -> FingertipPlan:
    """All strikes at the beginnings of their frames."""
    onset = np.floor(plan.strikes.onset / FRAME_SECONDS) * FRAME_SECONDS
    return replace(plan, strikes=replace(plan.strikes, onset=onset))


def scales(tracker: KeystrokeTracker, by_frame: bool = False) -> NDArray[np.float64]:
    """By how much the notes of two scales are late [ms], NaN where they are missed."""
    late = []
    for lowest in (27, 39):
        score = scale(lowest)
        plan = plan_of(score)
        late.append(listen(tracker, floored(plan) if by_frame else plan, score).late)
    return 1000 * np.concatenate(late)


@cache
def edge_chords() -> Score:
    """Four chords, whose notes are 6 ms before and 6 ms after the end of a frame."""
    key, onset = [], []
    for number in range(4):
        for place, each in enumerate((27, 34, 43, 46)):
            key.append(each + 2 * (number % 2))
            onset.append(0.06 + 0.4 * number + (-0.006 if place % 2 else 0.006))
    return notes(key, onset, 0.25)


def spreads(heard: Heard, score: Score) -> NDArray[np.float64]:
    """(4,) Time from the first to the last note of each of those chords [ms]."""
    return 1000 * np.ptp(np.sort(score.onset + heard.late).reshape(4, 4), axis=1)


def test_notes_within_a_frame_are_struck_at_their_times() -> None:
    late = scales(PLAIN)
    assert not np.isnan(late).any()
    assert np.median(np.abs(late)) < 10
    assert np.percentile(np.abs(late), 90) < 20
    # This sees whether strikes are at the beginnings of frames instead.
    assert np.percentile(np.abs(scales(PLAIN, by_frame=True)), 90) > 25


def test_more_controls_than_one_a_frame_are_needed_to_be_on_time() -> None:
    """What rehearsing cannot mend, for there is one control to begin with."""
    fine = scales(RehearsedTracker(PLAIN))
    coarse = scales(RehearsedTracker(KeystrokeTracker(KeystrokeConfig(controls=1))))
    assert np.percentile(np.abs(fine), 90) < 8
    assert np.percentile(np.abs(coarse), 90) > 8


def test_chords_across_the_end_of_a_frame_are_together() -> None:
    score = edge_chords()
    plan, rehearsed = plan_of(score), RehearsedTracker(PLAIN)
    # The score's own spread is 12 ms.
    assert np.median(spreads(listen(PLAIN, plan, score), score)) < 35
    assert spreads(listen(rehearsed, plan, score), score).max() < 30
    assert spreads(listen(rehearsed, floored(plan), score), score).min() > 40


@pytest.mark.parametrize("apart", [0.19, 0.23, 0.31])
def test_repeated_notes_are_struck_again(apart: float) -> None:
    score = notes([44] * 6 + [30] * 6, np.tile(np.arange(6) * apart, 2), 0.9 * apart)
    heard = listen(RehearsedTracker(PLAIN), plan_of(score), score)
    assert heard.missed <= 1
    assert heard.phantoms == 0


def test_soft_and_loud() -> None:
    velocity = np.where(np.arange(14) % 2, 100, 40)
    score = scale(velocity=velocity)
    plan = plan_of(score)

    def correlation(config: StrokeConfig) -> float:
        tracker = RehearsedTracker(KeystrokeTracker(KeystrokeConfig(stroke=config)))
        heard = listen(tracker, plan, score).velocity
        known = np.isfinite(heard)
        assert known.sum() >= 12
        return float(np.corrcoef(heard[known], velocity[known])[0, 1])

    assert correlation(StrokeConfig()) > 0.8
    assert abs(correlation(StrokeConfig(even=True))) < 0.4


@pytest.mark.parametrize("controls", [1, 2, 5, 10])
def test_a_control_for_every_part_of_a_frame(controls: int) -> None:
    score = scale().clip(0, 1.0)
    plan = plan_of(score)
    controller = KeystrokeTracker(KeystrokeConfig(controls=controls)).start(plan)
    assert controller.controls_per_frame == controls_per_frame(controller) == controls
    ctrl, heard = play(controller)
    assert ctrl.shape == (controls * len(plan), 46)
    assert np.isfinite(ctrl).all()
    assert {strike.key for strike in heard} <= set(score.key.tolist())
    # Beyond the end there is none.
    with pytest.raises(IndexError):
        controller.control(controls * len(plan), World())


def test_same_plan_same_controls() -> None:
    plan = plan_of(scale().clip(0, 1.2))
    first, heard = play(PLAIN.start(plan))
    # A tracker has no memory of what it started before.
    PLAIN.start(plan_of(notes([60, 20], [0.1, 0.3])))
    for tracker in (PLAIN, KeystrokeTracker()):
        again, heard_again = play(tracker.start(plan))
        np.testing.assert_array_equal(first, again)
        assert heard == heard_again


def test_a_control_depends_on_plan_number_and_world_alone() -> None:
    controller, world = PLAIN.start(plan_of(scale().clip(0, 1.0))), World()
    assert controller.replayable
    numbers = range(FRAMES * 5)
    before = world.state()
    forward = [controller.control(number, world) for number in numbers]
    backward = [controller.control(number, world) for number in reversed(numbers)]
    np.testing.assert_array_equal(forward, backward[::-1])
    np.testing.assert_array_equal(world.state(), before)
    # And it is what the caller's to change.
    kept = forward[0].copy()
    forward[0][:] = 0
    np.testing.assert_array_equal(controller.control(0, world), kept)


def arrays(plan: FingertipPlan) -> list[NDArray]:
    mine = [plan.fingertips, plan.finger_key, plan.note_hand, plan.note_finger]
    return mine + [getattr(plan.strikes, each.name) for each in fields(plan.strikes)]


@pytest.mark.parametrize("tracker", [PLAIN, RehearsedTracker(PLAIN)], ids=["plain", "rehearsed"])
def test_the_plan_is_left_as_it_was(tracker: KeystrokeTracker) -> None:
    plan = plan_of(scale().clip(0, 0.8))
    kept = [array.copy() for array in arrays(plan)]
    controller = tracker.start(plan)
    assert controller.plan is plan
    play(controller)
    for now, before in zip(arrays(plan), kept, strict=True):
        np.testing.assert_array_equal(now, before)


@pytest.mark.parametrize("effort", [0, 1])
def test_nothing_to_play(effort: int) -> None:
    performance = load_player("zero-shot", effort).play(Score(*np.zeros((4, 0))))
    assert performance.event_key.size == 0
    assert np.isfinite(performance.ctrl).all()


def test_a_piece_without_any_finger_on_it_is_silence() -> None:
    """All notes were dropped: frames, and no strikes."""
    plan = plan_of(scale().clip(0, 1.0))
    nobody = {each.name: getattr(plan.strikes, each.name)[:0] for each in fields(plan.strikes)}
    silent = replace(
        plan,
        fingertips=plan.fingertips + [0.0, 0.0, 0.05],
        finger_key=np.full_like(plan.finger_key, -1),
        strikes=replace(plan.strikes, **nobody),
    )
    assert play(PLAIN.start(silent))[1] == []


def test_a_plan_without_strikes_is_refused_in_one_line() -> None:
    plan = replace(plan_of(scale().clip(0, 0.5)), strikes=None)
    for tracker in (PLAIN, RehearsedTracker(PLAIN)):
        with pytest.raises(InputError, match="has no strikes") as error:
            tracker.start(plan)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("controls", [3, 4, 7, 0, 11, -5, 2.5])
def test_controls_divide_the_steps_of_a_frame(controls: float) -> None:
    with pytest.raises(InputError, match="controls must"):
        KeystrokeConfig(controls=controls)


@pytest.mark.parametrize("name", ["joint_feedback", "tip_feedback", "astray", "sunk", "clear"])
@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf])
def test_settings_that_cannot_be_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=f"{name.replace('_', '-')} must be 0 or more"):
        KeystrokeConfig(**{name: value})


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--tracker.touch", "heavy", "touch must be one of goebl-bresin, cantabile, not 'heavy'"),
        ("--tracker.controls", "3", "controls must divide 10, not be 3"),
        ("--rehearsal.passes", "-1", "passes must be 0 or more, not -1"),
    ],
)
def test_the_command_line_refuses_them_in_one_line(
    option: str, value: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["play", "twinkle-twinkle", f"{option}={value}"])
    assert stopped.value.code == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count("\n") == 1
