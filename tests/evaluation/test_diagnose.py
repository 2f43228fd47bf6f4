from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.image import imread
from numpy.typing import NDArray

import made_up
from any_score import score_of
from pianomime import Performance
from pianomime.cli import main
from pianomime.evaluation.diagnose import (
    NOBODY,
    Cause,
    Diagnosis,
    Fault,
    diagnose,
    frames_by_cause,
    totals,
)
from pianomime.keyboard import key_name
from pianomime.plan import FingertipPlan
from pianomime.plan.joint_path import HOME, WHITE_REST
from pianomime.report import DIAGNOSIS_FILES, write_diagnosis
from pianomime.world.hand import Hand
from pianomime.world.parameters import key_centres

KEY, FIRST, END = 51, 4, 10
LAST = 15  # frame of a low note that only makes the piece long enough
FRAMES = 17
RIGHT, MIDDLE = 1, 2


class Stage:
    """A note on one key, planned for the right middle finger and played well; to be spoilt.

    Attributes:
        finger_key, fingertips: the plan.
        tip: (T, 2) [m] how far the middle finger is from the middle of its key, along the
            keyboard, and above the keys.
        key_state: (T, 88) 0..1; pressed where it is 1.
        blow_ups: frames.
    """

    def __init__(self) -> None:
        self.finger_key = np.full((FRAMES, 2, 5), -1, np.int8)
        self.finger_key[FIRST:END, RIGHT, MIDDLE] = KEY
        self.fingertips = np.zeros((FRAMES, 2, 6, 3))
        self.fingertips[:, RIGHT, 1 + MIDDLE, 1] = key_centres()[KEY, 1]
        self.tip = np.zeros((FRAMES, 2))
        self.key_state = np.zeros((FRAMES, 88))
        self.key_state[FIRST:END, KEY] = 1.0
        self.key_state[LAST, 10] = 1.0
        self.blow_ups: list[int] = []

    def performance(self) -> Performance:
        score = score_of((KEY, FIRST, END), (10, LAST, LAST + 1))
        hand = Hand("rh")
        qpos = np.zeros((FRAMES, 142))
        qpos[:, hand.joints] = [_pose(hand, aside, above) for aside, above in self.tip]
        return replace(
            made_up.performance(score, mistakes=0.0),
            plan=FingertipPlan(
                self.fingertips, self.finger_key, np.ones(2, np.int8), np.full(2, 2, np.int8)
            ),
            qpos=qpos,
            key_state=self.key_state,
            pressed=self.key_state == 1.0,
            blow_ups=np.array(self.blow_ups, np.int64),
        )


def _pose(hand: Hand, aside: float, above: float) -> NDArray[np.float64]:
    """The home pose, slid so that the middle finger is over its key (the left hand stays away)."""
    pose = np.clip(HOME, hand.low, hand.high)
    tip = hand.points(pose)[1 + MIDDLE]
    # The forearms slide along the keyboard and up.
    pose[0] += key_centres()[KEY, 1] + aside - tip[1]
    pose[2] += WHITE_REST + above - tip[2]
    np.testing.assert_allclose(hand.points(pose)[1 + MIDDLE, 1], key_centres()[KEY, 1] + aside)
    return pose


def nothing_planned(stage: Stage) -> None:
    stage.finger_key[FIRST:END] = -1
    stage.key_state[FIRST:END, KEY] = 0.0


def planned_aside(stage: Stage) -> None:
    stage.fingertips[..., 1] += 0.03
    stage.key_state[FIRST:END, KEY] = 0.0


def beside(stage: Stage) -> None:
    stage.tip[FIRST:END, 0] = 0.03
    stage.key_state[FIRST:END, KEY] = 0.0


def above(stage: Stage) -> None:
    stage.tip[FIRST:END, 1] = 0.01
    stage.key_state[FIRST:END, KEY] = 0.0


def late(stage: Stage) -> None:
    stage.key_state[FIRST : FIRST + 2, KEY] = 0.0, 0.5


def shallow(stage: Stage) -> None:
    stage.key_state[FIRST:END, KEY] = 0.6


def comes_up(stage: Stage) -> None:
    stage.key_state[END - 2, KEY] = 0.9


def early(stage: Stage) -> None:
    stage.key_state[FIRST - 2 : FIRST, KEY] = 1.0


def released_late(stage: Stage) -> None:
    stage.key_state[END : END + 3, KEY] = 1.0


def not_wanted(stage: Stage) -> None:
    stage.finger_key[END + 1 : END + 3, RIGHT, 4] = KEY
    stage.key_state[END + 1 : END + 3, KEY] = 1.0


def neighbour(stage: Stage) -> None:
    stage.key_state[FIRST + 1 : FIRST + 4, KEY + 1] = 1.0
    stage.tip[FIRST + 1 : FIRST + 4, 0] = 0.012


def idle(stage: Stage) -> None:
    stage.key_state[END + 1 : END + 3, KEY + 1] = 1.0
    stage.tip[END + 1 : END + 3, 0] = 0.012


def no_tip(stage: Stage) -> None:
    stage.key_state[END + 1 : END + 3, KEY + 20] = 1.0


def stuck(stage: Stage) -> None:
    stage.key_state[END : END + 3, KEY] = 1.0
    stage.tip[END : END + 3, 1] = 0.03


def broken(stage: Stage) -> None:
    stage.blow_ups = [FIRST - 1]
    stage.key_state[FIRST:END, KEY] = 0.0


@pytest.mark.parametrize(
    ("spoil", "missed", "cause", "first", "frames", "blamed"),
    [
        (nothing_planned, True, Cause.NOT_PLANNED, FIRST, END - FIRST, False),
        (planned_aside, True, Cause.PLANNED_ASIDE, FIRST, END - FIRST, True),
        (beside, True, Cause.BESIDE, FIRST, END - FIRST, True),
        (above, True, Cause.ABOVE, FIRST, END - FIRST, True),
        (late, True, Cause.LATE, FIRST, 2, True),
        (shallow, True, Cause.SHALLOW, FIRST, END - FIRST, True),
        (comes_up, True, Cause.SHALLOW, END - 2, 1, True),
        (broken, True, Cause.BROKEN, FIRST, END - FIRST, False),
        (early, False, Cause.EARLY, FIRST - 2, 2, True),
        (released_late, False, Cause.RELEASED_LATE, END, 3, True),
        (neighbour, False, Cause.NEIGHBOUR, FIRST + 1, 3, True),
        (idle, False, Cause.IDLE, END + 1, 2, True),
        (no_tip, False, Cause.NO_TIP, END + 1, 2, False),
        (stuck, False, Cause.NO_TIP, END, 3, False),
    ],
)
def test_every_cause_is_recognised(
    spoil: Callable[[Stage], None],
    missed: bool,
    cause: Cause,
    first: int,
    frames: int,
    blamed: bool,
) -> None:
    stage = Stage()
    spoil(stage)
    (fault,) = (fault for fault in diagnose(stage.performance()).faults if fault.key != 10)
    assert (fault.missed, fault.cause, fault.first, fault.frames) == (missed, cause, first, frames)
    assert (fault.hand, fault.finger) == ((RIGHT, MIDDLE) if blamed else (NOBODY, NOBODY))
    assert fault.note == (0 if missed else NOBODY)


def test_a_key_that_the_plan_presses_unasked_is_the_plans_fault() -> None:
    stage = Stage()
    not_wanted(stage)
    (fault,) = diagnose(stage.performance()).faults
    assert (fault.cause, fault.hand, fault.finger) == (Cause.PLANNED_WRONG, RIGHT, 4)


def test_a_perfect_performance_has_no_faults() -> None:
    diagnosis = diagnose(Stage().performance())
    assert diagnosis.faults == []
    assert diagnosis.wanted == END - FIRST + 1
    assert totals([diagnosis]) == []


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10_000), st.floats(0, 1))
def test_faults_add_up_to_what_went_wrong(seed: int, mistakes: float) -> None:
    performance = made_up.performance(made_up.score(20, 2.0, seed=seed), mistakes, seed=seed)
    diagnosis = diagnose(performance)
    wanted = performance.score.roll()
    for missed, cells in (
        (True, wanted & ~performance.pressed),
        (False, performance.pressed & ~wanted),
    ):
        covered = np.zeros_like(cells, int)
        for fault in diagnosis.faults:
            if fault.missed == missed:
                covered[fault.first : fault.first + fault.frames, fault.key] += 1
        np.testing.assert_array_equal(covered, cells)
        kind = frames_by_cause(diagnosis)["missed" if missed else "wrong"]
        assert isinstance(kind, dict)
        assert sum(kind.values()) == cells.sum()
    assert diagnosis.wanted == wanted.sum()
    assert diagnose(performance) == diagnosis


def test_totals_add_up_over_songs_and_count_a_missed_note_once() -> None:
    def fault(first: int, note: int, finger: int, frames: int = 1) -> Fault:
        return Fault(True, 40, first, frames, Cause.BESIDE, 0, finger, note)

    wrong = Fault(False, 41, 0, 2, Cause.IDLE, 1, 0, NOBODY)
    one = Diagnosis("one", "made up", 10, [fault(0, 0, 4), fault(3, 0, 2, 4), fault(9, 1, 4)])
    two = Diagnosis("two", "made up", 30, [fault(0, 0, 4), wrong, replace(wrong, first=5)])
    beside, idle = totals([one, two])
    assert (beside.frames, beside.share, beside.notes) == (7, 7 / 40, 3)
    assert (beside.hand, beside.finger) == (0, 2)  # 4 frames; the little finger's are 1 each
    assert (idle.missed, idle.cause, idle.frames, idle.notes) == (False, Cause.IDLE, 4, 2)


def test_keys_have_the_names_that_musicians_use() -> None:
    assert [key_name(key) for key in (0, 1, 39, 87)] == ["A0", "A♯0", "C4", "C8"]


@pytest.fixture
def saved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A made-up performance in a folder of its own, which is where we are."""
    made_up.performance(made_up.score(title="Étude [1]")).save(tmp_path / "performance.npz")
    monkeypatch.chdir(tmp_path)
    return Path("performance.npz")


def test_every_fault_can_be_read_back(saved: Path, tmp_path: Path) -> None:
    performances = [Performance.load(saved), Stage().performance()]
    diagnoses = write_diagnosis(performances, tmp_path)
    content = json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))
    assert list(content) == ["causes", "songs"]
    for read, diagnosis in zip(content["songs"], diagnoses, strict=True):
        faults = [Fault(**{**fault, "cause": Cause(fault["cause"])}) for fault in read["faults"]]
        assert Diagnosis(**{**read, "faults": faults}) == diagnosis


def test_the_command_writes_beside_the_performance_and_tells_the_causes(
    saved: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["diagnose", str(saved)])
    assert sorted(os.listdir()) == [*DIAGNOSIS_FILES, "performance.npz"]
    printed = capsys.readouterr().out
    assert "Étude [1]" in printed
    for total in totals([diagnose(Performance.load(saved))]):
        assert total.cause in printed
    assert imread("diagnosis.png").shape[1] == 1320

    main(["diagnose", str(saved), str(saved), "-o", "deep/out"])
    assert sorted(os.listdir("deep/out")) == [*DIAGNOSIS_FILES]
    assert "2 songs" in capsys.readouterr().out


def test_perfection_can_be_explained_too(tmp_path: Path) -> None:
    Stage().performance().save(tmp_path / "perfect.npz")
    main(["diagnose", str(tmp_path / "perfect.npz")])
    content = json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))
    assert content["causes"] == []


def test_what_cannot_be_explained_is_one_line(
    saved: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made_up.performance(made_up.score(), planned=False).save("no plan.npz")
    Path("text.npz").write_text("this is no performance")
    np.savez("other.npz", something=np.zeros(3))
    before = sorted(os.listdir())
    for arguments, message in (
        (["missing.npz"], "missing.npz"),
        (["text.npz"], "text.npz: not a performance"),
        (["other.npz"], "other.npz: not a performance"),
        (["."], "directory"),
        (["no plan.npz"], "no plan.npz: made up played it without a fingertip plan"),
        ([str(saved), "no plan.npz"], "no plan.npz"),
        ([], "no performance to diagnose"),
        ([str(saved), "-o", "text.npz"], "text.npz: is a file"),
    ):
        with pytest.raises(SystemExit) as stopped:
            main(["diagnose", *arguments])
        assert stopped.value.code == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        (line,) = printed.err.splitlines()
        assert message in line
    assert sorted(os.listdir()) == before


def test_without_a_plan_there_is_nothing_to_explain() -> None:
    with pytest.raises(ValueError, match="plan"):
        diagnose(made_up.performance(made_up.score(), planned=False))
