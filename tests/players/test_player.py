from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pianomime import excerpt, load_player
from pianomime.errors import InputError
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.players import PlannedPlayer
from pianomime.world import World


def two_notes() -> Score:
    return Score(
        key=np.array([40, 44]),
        onset=np.array([2.0, 6.0]),
        offset=np.array([3.0, 7.0]),
        velocity=np.array([80, 90]),
        pedal=np.array([[1.0, 2.5]]),
        title="two notes",
    )


def test_an_excerpt_begins_with_its_first_note() -> None:
    whole = excerpt(two_notes())
    np.testing.assert_allclose(whole.onset, [0.0, 4.0])
    np.testing.assert_allclose(excerpt(two_notes(), start=3.5).onset, [0.0])
    np.testing.assert_allclose(excerpt(two_notes(), seconds=4.5).offset, [1.0, 4.5])
    assert len(excerpt(two_notes(), seconds=2.0)) == 1


@pytest.mark.parametrize(
    ("start", "seconds", "message"),
    [
        (0.0, 0.0, "seconds must be more than 0"),
        (0.0, -3.0, "seconds must be more than 0"),
        (0.0, float("nan"), "seconds must be more than 0"),
        (-1.0, 30.0, "start must be 0 or more"),
        (float("nan"), 30.0, "start must be 0 or more"),
        (7.0, 30.0, "two notes lasts 7.0 s"),
    ],
)
def test_excerpts_that_make_no_sense_are_refused(
    start: float, seconds: float, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        excerpt(two_notes(), start, seconds)


def test_a_lead_in_is_silence_before_the_music() -> None:
    part = excerpt(two_notes(), seconds=4.5, lead_in=0.7)
    np.testing.assert_allclose(part.onset, [0.7, 4.7])
    np.testing.assert_allclose(part.offset, [1.7, 5.2])
    np.testing.assert_allclose(part.pedal, [[0.7, 1.2]])


@pytest.mark.parametrize("lead_in", [-0.1, float("nan"), float("inf"), 1e9])
def test_lead_ins_that_make_no_sense_are_refused(lead_in: float) -> None:
    with pytest.raises(InputError, match="lead-in must be 0 to 14400 s"):
        excerpt(two_notes(), lead_in=lead_in)


class NoPlanner:
    """Plans nothing."""

    def plan(self, score: Score) -> FingertipPlan:
        frames = len(score.roll())
        return FingertipPlan(
            np.zeros((frames, 2, 6, 3)),
            np.full((frames, 2, 5), -1, np.int8),
            np.full(len(score), -1, np.int8),
            np.full(len(score), -1, np.int8),
        )


class Waving:
    """A controller that waves, and writes down when it is asked what."""

    replayable = True

    def __init__(self, plan: FingertipPlan) -> None:
        self.plan = plan
        self.asked: list[int] = []

    def control(self, frame: int, world: World) -> np.ndarray:
        self.asked.append(frame)
        return np.full(46, 0.01 * (frame % 5))


class WavingTracker:
    """Keeps the controllers that it started."""

    def __init__(self) -> None:
        self.started: list[Waving] = []

    def start(self, plan: FingertipPlan) -> Waving:
        self.started.append(Waving(plan))
        return self.started[-1]


def test_a_player_asks_for_every_frame_once_and_records_what_happened() -> None:
    tracker = WavingTracker()
    score = excerpt(two_notes(), seconds=2.0)
    told: list[tuple[str, int, int]] = []

    def progress(phase: str, done: int, total: int, remark: str = "") -> None:
        told.append((phase, done, total))

    performance = PlannedPlayer("one finger", NoPlanner(), tracker).play(score, progress)
    (one,) = tracker.started

    frames = len(score.roll())
    assert one.asked == list(range(frames))
    assert len(performance) == frames
    assert performance.player == "one finger"
    assert performance.effort == 0
    assert performance.dropped_notes == len(score)
    np.testing.assert_array_equal(performance.pedal, score.pedal_roll())
    assert told[0] == ("planning", 0, 0)
    assert told[-1] == ("playing", frames, frames)

    # Replaying the recorded controls leads through the recorded states.
    world = World()
    for frame in range(frames):
        world.step(performance.ctrl[frame], pedal=bool(performance.pedal[frame]))
        np.testing.assert_array_equal(world.qpos, performance.qpos[frame])
        np.testing.assert_array_equal(world.pressed, performance.pressed[frame])
        np.testing.assert_array_equal(world.key_state, performance.key_state[frame])


@pytest.mark.parametrize(
    ("player", "effort", "parts"),
    [
        ("zero-shot", 0, ["paths", "controls"]),
        ("zero-shot", 1, ["paths", "controls", "rehearsal"]),
        ("zero-shot-20hz", 0, ["controls"]),
    ],
)
def test_every_part_of_planning_says_how_far_it_is(
    player: str, effort: int, parts: list[str]
) -> None:
    """The fingering, paths, controls: a bar each, which ends when the part does."""
    told: list[tuple[str, int, int]] = []

    def progress(phase: str, done: int, total: int, remark: str = "") -> None:
        told.append((phase, done, total))

    load_player(player, effort).play(excerpt(two_notes(), seconds=1.0), progress)
    parts = ["planning", "fingering", "hand paths", *parts, "playing"]
    assert list(dict.fromkeys(phase for phase, _, _ in told)) == parts
    for part in parts[1:]:
        steps = [done for phase, done, _ in told if phase == part]
        (total,) = {total for phase, _, total in told if phase == part}
        assert steps == sorted(steps)
        assert steps[-1] == total

    # Whoever plans without being asked how far it is tells nobody.
    before = len(told)
    load_player(player, effort).start(excerpt(two_notes(), seconds=1.0))
    assert len(told) == before


def test_frames_in_which_the_physics_broke_are_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    class Fragile(World):
        steps = 0

        def step(self, ctrl: np.ndarray, pedal: bool = False, **more: Any) -> None:
            super().step(ctrl, pedal, **more)
            Fragile.steps += 1
            if Fragile.steps in (3, 4, 8):
                self.blow_ups += 1

    monkeypatch.setattr("pianomime.players.player.World", Fragile)
    player = PlannedPlayer("one finger", NoPlanner(), WavingTracker())
    performance = player.play(excerpt(two_notes(), seconds=2.0))
    assert performance.blow_ups.tolist() == [2, 3, 7]


def test_an_unknown_player_is_refused_with_a_list() -> None:
    with pytest.raises(InputError, match=r"no player 'liszt'.*zero-shot"):
        load_player("liszt")
