"""One hand alone: it plays as it does beside the other, which is out of the way."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.world import World, WorldBatch
from pianomime.world.layout import LAYOUT
from pianomime.world.one_hand import one_hand_model, state_of_one_hand


@pytest.mark.parametrize("hand", [0, 1])
def test_it_moves_as_in_the_whole_world(hand: int, song_controls: NDArray[np.float64]) -> None:
    both = World()
    for ctrl in song_controls[:20]:
        both.step(ctrl)
    assert np.abs(both.qvel_hands).max() > 0.01
    alone = WorldBatch(2, 1, model=one_hand_model(hand))
    alone.set_state(state_of_one_hand(both.state(), hand))
    for ctrl in song_controls[20:26]:
        both.step(ctrl)
        alone.step(np.tile(ctrl, (2, 1)))
    mine, other = LAYOUT.joints[hand], LAYOUT.joints[1 - hand]
    np.testing.assert_allclose(alone.qpos[:, mine], np.tile(both.qpos[mine], (2, 1)), atol=2e-3)
    assert not alone.qpos[:, other].any(), "the other hand was woken"
    assert not alone.blow_ups.any()


def test_the_state_of_the_hand_and_of_all_keys_is_kept(song_controls: NDArray[np.float64]) -> None:
    both = World()
    for ctrl in song_controls[:30]:
        both.step(ctrl)
    alone = World(one_hand_model(1))
    alone.set_state(state_of_one_hand(both.state(), 1))
    kept = np.ones(LAYOUT.qpos_size, bool)
    kept[LAYOUT.joints[0]] = False
    np.testing.assert_array_equal(alone.qpos[kept], both.qpos[kept])
    np.testing.assert_array_equal(alone.data.qvel[kept], both.data.qvel[kept])
    assert alone.name == both.name


def test_an_unknown_world_is_refused() -> None:
    with pytest.raises(InputError, match="nowhere"):
        one_hand_model(0, "nowhere")
