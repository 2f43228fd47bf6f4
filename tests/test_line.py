"""Any score down the whole line: plan, track, world, performance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from any_score import scores
from pianomime import load_player, songs
from pianomime.music import Score
from pianomime.music.excerpt import excerpt
from pianomime.world import World
from pianomime.world.parameters import key_centres


@pytest.mark.filterwarnings("ignore::pianomime.world.PhysicsWarning")
# Those that learned have weights, and tests, of their own.
@pytest.mark.parametrize(
    ("player", "controls"), [("zero-shot", 5), ("zero-shot-20hz", 1), ("zero-shot-ik", 1)]
)
@settings(max_examples=12, deadline=None)
@given(score=scores())
def test_any_score_is_played(player: str, controls: int, score: Score) -> None:
    performance = load_player(player).play(score)
    frames = len(score.roll())
    assert performance.ctrl.shape == (frames, controls, 46)
    assert performance.qpos.shape == (frames, 142)
    assert performance.key_state.shape == performance.pressed.shape == (frames, 88)
    for name in ("ctrl", "qpos", "key_state"):
        assert np.isfinite(getattr(performance, name)).all(), name
    assert ((performance.key_state >= 0) & (performance.key_state <= 1)).all()
    np.testing.assert_array_equal(performance.pedal, score.pedal_roll())


def test_no_key_stays_down_without_a_finger() -> None:
    # Keys that MuJoCo had let sleep while they were held stayed down for seconds in this piece.
    score = excerpt(Score.from_midi(songs.path("c-major-study")), seconds=12)
    performance = load_player("zero-shot", effort=0).play(score)
    world = World()
    for frame in range(2, len(performance)):
        world.reset(performance.qpos[frame])
        along = world.fingertips[:, 1:, 1].ravel()
        for key in np.flatnonzero(performance.pressed[frame - 2 : frame + 1].all(axis=0)):
            assert np.abs(along - key_centres()[key, 1]).min() < 0.04
