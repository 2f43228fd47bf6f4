"""Any score down the whole line: plan, track, world, performance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from any_score import scores
from pianomime.music import Score
from pianomime.play import PLAYERS, Player


@pytest.mark.filterwarnings("ignore::pianomime.world.PhysicsWarning")
@pytest.mark.parametrize("player", sorted(PLAYERS))
@settings(max_examples=12, deadline=None)
@given(score=scores())
def test_any_score_is_played(player: str, score: Score) -> None:
    # One frame alone is beyond the planner for now.
    performance = Player.from_name(player).play(score)
    frames = len(score.roll())
    assert performance.ctrl.shape == (frames, 46)
    assert performance.qpos.shape == (frames, 142)
    assert performance.key_state.shape == performance.pressed.shape == (frames, 88)
    for name in ("ctrl", "qpos", "key_state"):
        assert np.isfinite(getattr(performance, name)).all(), name
    assert ((performance.key_state >= 0) & (performance.key_state <= 1)).all()
    np.testing.assert_array_equal(performance.pedal, score.pedal_roll())
    metrics = performance.metrics()
    assert all(0.0 <= metrics[name] <= 1.0 for name in ("precision", "recall", "f1"))
    assert 0 <= performance.dropped_notes <= len(score)
