"""The rules of the diagnosis at their edges: one frame, one millimetre to either side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import made_up
from pianomime import Score
from pianomime.evaluation.diagnose import Cause, Fault, _Scene, diagnose
from pianomime.plan import FingertipPlan
from pianomime.world.parameters import key_centres, key_half_sizes

FRAMES, KEY, RIGHT, MIDDLE = 40, 51, 1, 2
HALF = key_half_sizes()[KEY, 1]
ALONG = key_centres()[KEY, 1]


class Scene:
    """One key for the right middle finger, in some frames; all fingertips are far away but it."""

    def __init__(self, *wanted: tuple[int, int]) -> None:
        notes = np.array([*((KEY, *each) for each in wanted), (10, FRAMES - 1, FRAMES)])
        velocity = np.full(len(notes), 64)
        self.score = Score(notes[:, 0], notes[:, 1] / 20, notes[:, 2] / 20, velocity)
        frames = self.score.frames()
        self.finger_key = np.full((frames, 2, 5), -1, np.int8)
        self.key_state = np.zeros((frames, 88))
        self.key_state[FRAMES - 1, 10] = 1.0
        for first, end in wanted:
            self.finger_key[first:end, RIGHT, MIDDLE] = KEY
            self.key_state[first:end, KEY] = 1.0
        self.planned = np.full((frames, 2, 5), ALONG)
        self.tips = np.full((frames, 2, 5, 3), 9.0)
        self.tips[:, RIGHT, MIDDLE] = key_centres()[KEY]
        self.blow_ups: list[int] = []

    def faults(self, monkeypatch: pytest.MonkeyPatch) -> list[Fault]:
        frames = len(self.finger_key)
        points = np.zeros((frames, 2, 6, 3))
        points[:, :, 1:, 1] = self.planned
        notes = np.zeros(len(self.score), np.int8)
        performance = replace(
            made_up.performance(self.score, mistakes=0.0),
            plan=FingertipPlan(points, self.finger_key, notes, notes),
            key_state=self.key_state,
            pressed=self.key_state == 1.0,
            blow_ups=np.array(self.blow_ups, np.int64),
        )
        made = _Scene.of(performance)
        monkeypatch.setattr(_Scene, "of", lambda _: replace(made, tips=self.tips))
        faults = diagnose(performance).faults
        monkeypatch.undo()
        return [fault for fault in faults if fault.key != 10]

    def causes(self, monkeypatch: pytest.MonkeyPatch) -> list[tuple[Cause, int, int]]:
        return [(each.cause, each.first, each.frames) for each in self.faults(monkeypatch)]


@pytest.mark.parametrize("far", [False, True])
def test_a_finger_is_beside_its_key_from_three_millimetres_past_its_edge(
    far: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    way = HALF + 0.003 + (0.0005 if far else -0.0005)
    for sign in (-1, 1):
        scene = Scene((5, 9))
        scene.key_state[5:9, KEY] = 0.0
        scene.tips[:, RIGHT, MIDDLE, 1] = ALONG + sign * way
        assert scene.causes(monkeypatch) == [(Cause.BESIDE if far else Cause.ABOVE, 5, 4)]
        scene.planned[:, RIGHT, MIDDLE] = ALONG + sign * way
        wanted = Cause.PLANNED_ASIDE if far else Cause.ABOVE
        assert scene.causes(monkeypatch) == [(wanted, 5, 4)]


@pytest.mark.parametrize(("state", "cause"), [(0.04, Cause.ABOVE), (0.06, Cause.SHALLOW)])
def test_a_key_is_touched_from_a_twentieth_of_its_way(
    state: float, cause: Cause, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene((5, 9))
    scene.key_state[5:9, KEY] = state
    assert scene.causes(monkeypatch) == [(cause, 5, 4)]


def test_late_is_what_goes_down_later_in_the_same_press(monkeypatch: pytest.MonkeyPatch) -> None:
    """The press before it, a frame away, does not count."""
    scene = Scene((2, 6), (7, 12))
    scene.key_state[7:9, KEY] = 0.0
    assert scene.causes(monkeypatch) == [(Cause.LATE, 7, 2)]
    # Nor does the press after it; but the frame after the press does.
    scene = Scene((2, 6), (8, 12))
    scene.key_state[2:6, KEY] = 0.0
    assert scene.causes(monkeypatch) == [(Cause.ABOVE, 2, 4)]
    scene.key_state[6, KEY] = 1.0
    assert scene.causes(monkeypatch)[0] == (Cause.LATE, 2, 4)
    # A key that comes up and goes down again was not late.
    scene = Scene((5, 12))
    scene.key_state[8, KEY] = 0.5
    assert scene.causes(monkeypatch) == [(Cause.SHALLOW, 8, 1)]


@pytest.mark.parametrize("gap", [0, 4, 5])
def test_early_is_four_frames_before_a_note_at_most(
    gap: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene((20, 24))
    scene.key_state[20 - gap : 20, KEY] = 1.0
    causes = scene.causes(monkeypatch)
    idle = [(Cause.IDLE, 15, 1)] if gap == 5 else []
    assert causes == [*idle, (Cause.EARLY, 16, 4)] if gap else causes == []
    if gap:
        # It must stay down until then.
        scene.key_state[19, KEY] = 0.9
        assert {cause for cause, *_ in scene.causes(monkeypatch)} == {Cause.IDLE}


def test_released_late_is_what_stays_down(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene((5, 9))
    scene.key_state[9:20, KEY] = 1.0
    assert scene.causes(monkeypatch) == [(Cause.RELEASED_LATE, 9, 11)]
    scene.key_state[12, KEY] = 0.9
    assert scene.causes(monkeypatch) == [(Cause.RELEASED_LATE, 9, 3), (Cause.IDLE, 13, 7)]


def test_ten_frames_after_the_physics_broke_are_blamed_on_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = Scene((5, 30))
    scene.key_state[5:30, KEY] = 0.0
    scene.blow_ups = [10]
    assert scene.causes(monkeypatch) == [
        (Cause.ABOVE, 5, 5),
        (Cause.BROKEN, 10, 10),
        (Cause.ABOVE, 20, 10),
    ]


@pytest.mark.parametrize(("above", "cause"), [(0.012, Cause.IDLE), (0.014, Cause.NO_TIP)])
def test_a_fingertip_reaches_thirteen_millimetres(
    above: float, cause: Cause, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene((5, 9))
    scene.key_state[15:17, KEY] = 1.0
    scene.tips[:, RIGHT, MIDDLE, 2] += key_half_sizes()[KEY, 2] + above
    (fault,) = scene.faults(monkeypatch)
    assert (fault.cause, fault.first, fault.frames) == (cause, 15, 2)
    blamed = (RIGHT, MIDDLE) if cause == Cause.IDLE else (-1, -1)
    assert (fault.hand, fault.finger) == blamed


def test_faults_are_in_order_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene((5, 9), (20, 24))
    scene.key_state[[6, 22], KEY] = 0.5
    scene.key_state[12, KEY + 2] = scene.key_state[12, KEY - 2] = 1.0
    faults = scene.faults(monkeypatch)
    assert [(each.first, each.key - KEY) for each in faults] == [(6, 0), (12, -2), (12, 2), (22, 0)]
    assert [each.missed for each in faults] == [True, False, False, True]
