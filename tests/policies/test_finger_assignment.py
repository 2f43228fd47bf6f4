from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pianomime.keyboard import KEYS, NO_KEY
from pianomime.policies.features import rest_points
from pianomime.policies.finger_assignment import HOVER_HEIGHT, assign_fingers
from pianomime.world.parameters import key_centres, key_half_sizes

NOTHING = np.full((2, 5), NO_KEY, np.int8)


def goal_of(*keys):
    goal = np.zeros(KEYS, bool)
    goal[list(keys)] = True
    return goal


def over(hand, finger, key):
    tips = rest_points().copy()
    tips[hand, finger + 1] = [0.04, key_centres()[key, 1] + 0.004, 0.0]
    return tips


def test_the_nearest_finger_is_put_on_its_key():
    tips, keys = assign_fingers(over(1, 2, 44), goal_of(44), NOTHING)
    assert keys[1, 2] == 44
    assert (keys != NO_KEY).sum() == 1
    np.testing.assert_allclose(tips[1, 3], [0.04, key_centres()[44, 1], 0.0])
    assert (np.delete(tips[..., 2].ravel(), 9) == HOVER_HEIGHT).all()


def test_a_finger_that_holds_a_key_goes_on_even_if_another_is_nearer():
    before = NOTHING.copy()
    before[0, 4] = 44
    _, keys = assign_fingers(over(1, 2, 44), goal_of(44), before)
    np.testing.assert_array_equal(keys, before)


def test_a_key_out_of_reach_of_all_is_left_out():
    tips, keys = assign_fingers(rest_points().copy(), goal_of(87), NOTHING)
    assert (keys == NO_KEY).all()
    np.testing.assert_array_equal(tips[..., :2], rest_points()[..., :2])


def test_nobody_reaches_farther_than_two_white_keys():
    for away, reached in ((0.04, True), (0.05, False)):
        tips = rest_points().copy()
        tips[:, :, 1] -= 10.0  # nobody else is near
        tips[1, 3] = [0.04, key_centres()[44, 1] - away, 0.0]
        _, keys = assign_fingers(tips, goal_of(44), NOTHING)
        assert (keys[1, 2] == 44) == reached


def test_a_hand_moves_along_with_the_mean_of_its_pressing_fingers():
    before = rest_points().copy()
    before[1, [1, 3, 5], 1] -= 10.0  # nobody else is near
    for finger, key, away in ((1, 44, 0.004), (3, 47, 0.010)):
        before[1, finger + 1, 1] = key_centres()[key, 1] - away
    after, keys = assign_fingers(before, goal_of(44, 47), NOTHING)
    assert keys[1, [1, 3]].tolist() == [44, 47]
    idle = [0, 1, 3, 5]  # the wrist is point 0
    np.testing.assert_allclose(after[1, idle, 1], before[1, idle, 1] + 0.007)
    np.testing.assert_allclose(after[1, [2, 4], 1], key_centres()[[44, 47], 1])
    np.testing.assert_array_equal(after[0, :, 1], before[0, :, 1])


def test_on_black_keys_and_beyond_the_edge_fingers_stay_on_the_key():
    for key, x in ((40, 0.1), (40, -0.2), (39, 0.2), (39, -0.2)):
        tips = over(1, 1, key)
        tips[1, 2, 0] = x
        snapped, keys = assign_fingers(tips, goal_of(key), NOTHING)
        assert keys[1, 1] == key
        off = abs(snapped[1, 2, 0] - key_centres()[key, 0])
        assert off < key_half_sizes()[key, 0]


@settings(deadline=None, max_examples=50)
@given(
    keys=st.sets(st.integers(0, 87), max_size=14),
    before=st.lists(st.integers(-1, 87), min_size=10, max_size=10),
    seed=st.integers(0, 100),
)
def test_whatever_comes_each_key_has_one_finger_and_each_finger_one_key(keys, before, seed):
    draw = np.random.default_rng(seed)
    tips = rest_points() + draw.normal(0, 0.1, (2, 6, 3))
    held = np.array(before, np.int8)
    for key in set(before) - {-1}:  # no key was held twice
        held[np.flatnonzero(held == key)[1:]] = NO_KEY
    goal = goal_of(*keys)
    snapped, pressed = assign_fingers(tips, goal, held.reshape(2, 5))
    used = pressed[pressed != NO_KEY]
    assert len(set(used.tolist())) == len(used)
    assert goal[used].all()
    kept = (held != NO_KEY) & goal[np.maximum(held, 0)]
    np.testing.assert_array_equal(pressed.ravel()[kept], held[kept])
    np.testing.assert_array_equal(snapped[:, 1:, 2] == 0.0, pressed != NO_KEY)
