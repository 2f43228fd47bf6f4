"""The keystroke tracker: notes at their own times, with touch, and what its controllers promise."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from heard import Heard, listen, notes, plan_of, play, scale
from pianomime import load_player
from pianomime.cli import main
from pianomime.errors import InputError
from pianomime.keyboard import FRAME_SECONDS
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.plan.joint_path import PathProblem, resting_height
from pianomime.plan.keep_apart import smooth_paths
from pianomime.track import (
    KeystrokeConfig,
    KeystrokeTracker,
    RehearsedTracker,
    controls_per_frame,
    keystroke,
)
from pianomime.track.heard import strikes_in
from pianomime.track.strokes import StrokeConfig
from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT

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


def beside(world: World, hand: Hand, meters: float) -> World:
    """The same pose at rest, but for a forearm that is beside its place."""
    qpos = world.qpos.copy()
    qpos[hand.joints][LAYOUT.slide] += meters
    other = World()
    other.reset(qpos)
    return other


def test_a_finger_that_is_not_over_its_key_does_not_press_another_one() -> None:
    """The forearm is a key too far, shortly before its thumb strikes."""
    score = notes([44], [0.1], 0.3)
    plan, key_width = plan_of(score), 0.0235
    assert plan.strikes.hand.tolist() == [1]
    struck = {}
    for astray in (KeystrokeConfig().astray, 1.0):
        controller = KeystrokeTracker(KeystrokeConfig(astray=astray)).start(plan)
        world, keys = World(), []
        for number in range(5 * len(plan)):
            if number == 36:
                world = beside(world, Hand("rh"), key_width)
            world.step(controller.control(number, world), parts=5)
            keys += [strike.key for strike in strikes_in(world.key_events, 0.0)]
        struck[astray] = keys
    assert set(struck.pop(1.0)) == {44, 46}
    assert struck.popitem()[1] == [44]


def test_the_forearm_comes_back_and_also_for_a_finger_that_strikes() -> None:
    """The slide's own gain, and half of the error of a single finger that strikes."""
    controller, world = PLAIN.start(plan_of(notes([44], [0.1], 0.3))), World()
    for number in range(40):
        world.step(controller.control(number, world), parts=5)
    for side, gain in (("rh", 0.8 + 0.5), ("lh", 0.8)):
        hand = Hand(side)
        for off in (-0.003, 0.003):
            there, here = (beside(world, hand, meters) for meters in (off, 0.0))
            change = controller.control(40, there) - controller.control(40, here)
            slide = change[hand.actuators][LAYOUT.slide_actuators][0]
            assert slide == pytest.approx(-gain * off, rel=1e-3)


@pytest.mark.parametrize(("height", "sinks"), [(0.02, True), (0.028, None), (0.04, False)])
def test_an_idle_finger_that_has_sunk_between_keys_is_lifted(
    height: float, sinks: bool | None
) -> None:
    """The hand that has nothing to do hangs down from its wrist."""
    plan, world = plan_of(notes([44], [0.1], 0.3)), World()
    hand = Hand("lh")
    controls = [KeystrokeTracker(KeystrokeConfig(sunk=sunk)).start(plan) for sunk in (0.005, 1.0)]
    for number in range(40):
        world.step(controls[0].control(number, world), parts=5)
    lifted, as_it_is = (each.control(40, world) for each in controls)
    np.testing.assert_array_equal(lifted[hand.actuators], as_it_is[hand.actuators])
    low = world.qpos.copy()
    pose = low[hand.joints].copy()
    wrist = slice(LAYOUT.slide + 1, LAYOUT.arm_joints)
    for _ in range(5):
        points, jacobian = hand.points_and_jacobian(pose)
        down = jacobian[1:, 2, wrist].mean(axis=0)
        pose[wrist] -= down * (points[1:, 2].mean() - height) / (down @ down)
    low[hand.joints] = pose
    sunk = World()
    sunk.reset(low)
    tips = hand.points(pose)[1:]
    between = tips[:, 2] < resting_height(tips[:, 0]) - 0.005
    assert len(set(between)) == 2 if sinks is None else (between == sinks).all()
    lifted, as_it_is = (each.control(40, sunk) for each in controls)
    change = (lifted - as_it_is)[hand.actuators]
    for finger, actuators in enumerate(LAYOUT.finger_actuators):
        assert change[actuators].any() == between[finger]
    assert not (lifted - as_it_is)[Hand("rh").actuators].any()


def test_strokes_count_for_each_of_their_points_and_all_else_for_its_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan = plan_of(notes([44], [0.1], 0.3))
    weights: list[NDArray[np.float64]] = []

    def watched(problems: list[PathProblem], *given: Any) -> list[NDArray[np.float64]]:
        weights.extend(problem.weights for problem in problems)
        return smooth_paths(problems, *given)

    monkeypatch.setattr(keystroke, "smooth_paths", watched)
    found = {}
    for controls in (1, 5):
        KeystrokeTracker(KeystrokeConfig(controls=controls)).start(plan)
        left, right = weights[-2:]
        thumb = right[:, 1]
        found[controls] = left[0, 1, 0], thumb[0, 0], thumb[-1, 0], thumb[:, 0].max()
    idle_hand, before, after, stroke = np.array(found[5]) / found[1]
    assert idle_hand == pytest.approx(5**-0.5)
    assert before == pytest.approx(5**-0.5)
    assert after == pytest.approx(5**-0.5)
    assert stroke == pytest.approx(1.0)


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
