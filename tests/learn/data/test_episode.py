"""Episodes: one row, and one action, a frame."""

from __future__ import annotations

import numpy as np
import pytest

from pianomime import Score, load_player
from pianomime.errors import InputError
from pianomime.learn.data.episode import record


@pytest.fixture
def score() -> Score:
    one = np.array([0.5])
    return Score(np.array([40]), one, one + 0.5, np.array([64]))


def test_controls_are_recorded_as_they_were_sent(score: Score) -> None:
    player = load_player("zero-shot-20hz", effort=0)
    columns = record(player.start(score), score).columns
    sent = player.play(score).ctrl[:, 0]
    np.testing.assert_array_equal(columns["action"], sent.astype(np.float32))


@pytest.mark.parametrize("effort", [0, 1])
def test_several_controls_a_frame_are_no_action(score: Score, effort: int) -> None:
    player = load_player("zero-shot", effort)
    with pytest.raises(InputError, match=r"one control a frame, not 5: .* zero-shot-20hz") as error:
        record(player.start(score), score)
    assert "\n" not in str(error.value)
