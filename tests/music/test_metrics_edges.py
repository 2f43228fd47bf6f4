"""What metrics refuse, and differences of onsets at the edge of the tolerance."""

from __future__ import annotations

import numpy as np
import pytest

from pianomime.music import frame_metrics, onset_f1, pedal_f1
from pianomime.music.metrics import ONSET_TOLERANCE


@pytest.mark.parametrize(
    ("wanted", "pressed"), [((3, 88), (1, 88)), ((3, 88), (3, 1)), ((88,), (88,)), ((2, 3, 4),) * 2]
)
def test_rolls_that_could_be_compared_by_accident(
    wanted: tuple[int, ...], pressed: tuple[int, ...]
) -> None:
    with pytest.raises(ValueError, match="cannot compare arrays of shapes"):
        frame_metrics(np.zeros(wanted), np.zeros(pressed))


@pytest.mark.parametrize(("wanted", "played"), [((3,), (1,)), ((3, 1), (3, 1)), ((), ())])
def test_pedals_that_could_be_compared_by_accident(
    wanted: tuple[int, ...], played: tuple[int, ...]
) -> None:
    with pytest.raises(ValueError, match="cannot compare arrays of shapes"):
        pedal_f1(np.zeros(wanted), np.zeros(played))


def test_notes_are_two_rows_of_the_same_length() -> None:
    nothing: tuple[list[int], list[float]] = ([], [])
    for notes in (([1, 2], [0.0]), ([[1]], [[0.0]]), ([1], [[0.0]]), (1, 0.0)):
        for both in ((notes, nothing), (nothing, notes)):
            with pytest.raises(ValueError, match=r"must both be \(N,\)"):
                onset_f1(*both)


@pytest.mark.parametrize(
    ("late", "match"), [(0.05, 1), (0.05004, 1), (0.05006, 0), (-0.05004, 1), (-0.05006, 0)]
)
def test_times_are_rounded_to_a_tenth_of_a_millisecond(late: float, match: int) -> None:
    assert onset_f1(([5], [1.0]), ([5], [1.0 + late])) == match
    assert ONSET_TOLERANCE == 0.05


def test_notes_are_matched_key_by_key_in_any_order() -> None:
    wanted = [7, 3, 7, 5], [2.0, 1.0, 1.0, 4.0]
    played = [5, 7, 3, 7, 9], [4.04, 1.02, 1.06, 1.98, 1.0]
    assert onset_f1(wanted, played) == pytest.approx(2 * 3 / 9)


def test_metrics_are_numbers_of_python() -> None:
    roll = np.eye(4, 88)
    for value in (*frame_metrics(roll, roll), pedal_f1([1, 0], [1, 0])):
        assert type(value) is float
