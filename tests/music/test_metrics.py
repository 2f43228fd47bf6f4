"""Metrics against scikit-learn and mir_eval."""

import mir_eval
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import precision_recall_fscore_support

from pianomime.music import frame_metrics, notes_from_roll, onset_f1, pedal_f1

SEEDS = st.integers(0, 2**32 - 1)


def random_rolls(seed: int, frames: int = 12, keys: int = 88) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    wanted = generator.random((frames, keys)) < generator.choice([0.0, 0.01, 0.1])
    pressed = wanted ^ (generator.random((frames, keys)) < generator.choice([0.0, 0.01, 0.1]))
    wanted[0] = pressed[1] = wanted[2] = pressed[2] = False  # nothing wanted, pressed, or both
    return wanted, pressed


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_frame_metrics_are_those_of_scikit_learn(seed: int) -> None:
    wanted, pressed = random_rolls(seed)
    theirs = [
        precision_recall_fscore_support(w, p, average="binary", zero_division=1)[:3]
        for w, p in zip(wanted, pressed, strict=True)
    ]
    assert frame_metrics(wanted, pressed) == pytest.approx(np.mean(np.array(theirs, float), axis=0))


def test_frame_metrics_by_hand() -> None:
    wanted = np.zeros((4, 88), bool)
    pressed = np.zeros((4, 88), bool)
    wanted[1, :2] = pressed[1, 1:4] = True  # 1 of 2 wanted, 1 of 3 pressed
    wanted[2, 5] = True  # missed
    pressed[3, 5] = True  # not wanted
    precision, recall, f1 = frame_metrics(wanted, pressed)
    assert precision == pytest.approx((1 + 1 / 3 + 1 + 0) / 4)
    assert recall == pytest.approx((1 + 1 / 2 + 0 + 1) / 4)
    assert f1 == pytest.approx((1 + 2 / 5 + 0 + 0) / 4)


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_frame_metrics_laws(seed: int) -> None:
    wanted, pressed = random_rolls(seed)
    there, back = frame_metrics(wanted, pressed), frame_metrics(pressed, wanted)
    assert there.f1 == back.f1
    assert (there.precision, there.recall) == (back.recall, back.precision)
    assert frame_metrics(wanted, wanted) == (1, 1, 1)
    assert all(0 <= value <= 1 for value in there)


def test_arrays_that_do_not_match_are_refused() -> None:
    with pytest.raises(ValueError, match="shapes"):
        frame_metrics(np.zeros((3, 88)), np.zeros((4, 88)))
    with pytest.raises(ValueError, match="no frames"):
        frame_metrics(np.zeros((0, 88)), np.zeros((0, 88)))
    with pytest.raises(ValueError, match="shapes"):
        pedal_f1(np.zeros(3), np.zeros(4))
    with pytest.raises(ValueError, match="must both"):
        onset_f1(([1], [0.0]), ([1, 2], [0.0]))


def mir_eval_f1(
    wanted: tuple[np.ndarray, np.ndarray], played: tuple[np.ndarray, np.ndarray]
) -> float:
    def notes(key: np.ndarray, onset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.column_stack((onset, onset + 1)), 440.0 * 2 ** ((key - 48) / 12)

    return mir_eval.transcription.precision_recall_f1_overlap(
        *notes(*wanted), *notes(*played), offset_ratio=None
    )[2]


@given(SEEDS, st.booleans())
@settings(max_examples=60, deadline=None)
def test_onset_f1_is_that_of_mir_eval(seed: int, on_grid: bool) -> None:
    generator = np.random.default_rng(seed)

    def notes() -> tuple[np.ndarray, np.ndarray]:
        count = generator.integers(1, 40)
        onset = generator.uniform(0, 1.5, count)
        # Times on a grid often differ by the tolerance itself.
        return generator.integers(0, 4, count), np.round(onset, 2) if on_grid else onset

    wanted, played = notes(), notes()
    assert onset_f1(wanted, played) == pytest.approx(mir_eval_f1(wanted, played))


def test_onset_f1_by_hand() -> None:
    nothing: tuple[list[int], list[float]] = ([], [])
    assert onset_f1(nothing, nothing) == 1
    assert onset_f1(([1], [0.0]), nothing) == 0
    assert onset_f1(nothing, ([1], [0.0])) == 0
    assert onset_f1(([1], [1.0]), ([1], [1.05])) == 1
    assert onset_f1(([1], [1.0]), ([1], [1.0502])) == 0
    assert onset_f1(([1], [1.0]), ([2], [1.0])) == 0
    assert onset_f1(([1], [1.0]), ([1, 1], [1.0, 1.01])) == pytest.approx(2 / 3)
    # The first two must not take the only match of the third.
    assert onset_f1(([1, 1], [1.0, 1.08]), ([1, 1], [1.04, 0.96])) == 1
    assert onset_f1(([1], [1.0]), ([1], [1.2]), tolerance=0.2) == 1


def test_pedal_f1() -> None:
    assert pedal_f1([0, 0, 0], [0, 0, 0]) == 1
    assert pedal_f1([1, 0, 0], [0, 0, 0]) == 0
    assert pedal_f1([1, 1, 0, 0], [0, 1, 1, 0]) == 0.5
    assert pedal_f1([1, 1], [1, 1]) == 1


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_notes_from_roll_cover_it(seed: int) -> None:
    roll, _ = random_rolls(seed)
    key, onset, offset = notes_from_roll(roll, dt=0.05)
    covered = np.zeros_like(roll)
    for k, first, stop in zip(key, np.rint(onset * 20), np.rint(offset * 20), strict=True):
        assert not covered[int(first) : int(stop), k].any()
        covered[int(first) : int(stop), k] = True
    assert (covered == roll).all()
    assert (np.lexsort((key, onset)) == np.arange(len(key))).all()
