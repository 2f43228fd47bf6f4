"""The cost of keys that are wrong at the ends of frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.track.heard import Frame, Strike
from pianomime.track.sampling.key_cost import KeyCost

GOAL = np.zeros((4, KEYS), bool)
GOAL[1:3, [40, 44]] = True


def pressed(*keys: int) -> NDArray[np.bool_]:
    down = np.zeros(KEYS, bool)
    down[list(keys)] = True
    return down


def test_wrong_keys_are_counted_in_the_frames_that_count() -> None:
    frames = [Frame([], pressed(40)), Frame([], pressed(40, 44, 50)), Frame([], pressed(7))]
    cost = KeyCost(GOAL)
    assert cost.of(1, frames, 3) == (3.0, [(0, 44), (1, 50), (2, 7)])
    assert cost.of(1, frames, 1) == (1.0, [(0, 44)])


def test_a_tally_grows_by_what_is_wrong_in_each_frame() -> None:
    tally = KeyCost(GOAL).tally(2)
    for frame, wrong in ((pressed(40, 44), 0), (pressed(1, 2), 2)):
        before = tally.least
        tally.add(Frame([], frame))
        assert tally.least - before == wrong
    assert tally.total() == tally.least == 2.0


def test_what_sounded_before_does_not_count() -> None:
    cost, frame = KeyCost(GOAL), Frame([], pressed())
    cost.heard([Strike(40, 0.05, 1.0)])
    assert cost.of(1, [frame], 1)[0] == 2.0
