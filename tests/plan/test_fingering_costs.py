"""Every cost of the fingering, by hand: what it is of, and how it grows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from any_score import score_of
from pianomime.keyboard import BLACK, FRAME_SECONDS, KEYS
from pianomime.plan import LEFT, RIGHT
from pianomime.plan.fingering import find_fingering, frame_values
from pianomime.plan.fingering_cost import (
    FingeringConfig,
    Fingers,
    HandCost,
    Struck,
    chord_cost,
    hand_cost,
    pair_cost,
)
from pianomime.plan.reach import EASE, stretch
from pianomime.world.parameters import key_centres

ALONG = key_centres()[:, 1]
FREE = FingeringConfig(
    drop=0.0,
    cut=0.0,
    late=0.0,
    stretch=1e-12,
    strain=1e-12,
    travel_speed=1e9,
    hop_speed=1e9,
    reuse=0.0,
    thumb_on_black=0.0,
    weak_finger=0.0,
    crossed=0.0,
)
"""Nothing costs anything; each test gives one thing its price."""
ONSET = 10
WHITE, BLACK_KEY, FAR = 51, 52, 63
THUMB, INDEX, MIDDLE, RING, LITTLE = range(5)


def struck(*keys: int, lasts: int = 8, at_once: int = 1) -> Struck:
    """Keys that go down in frame 10, of a piece with so many keys in each frame."""
    value = np.arange(60) / at_once
    ends = np.full(len(keys), ONSET + lasts)
    return Struck(ONSET, np.array(keys), ends, value, unit=1 / at_once)


def strike(**fingers: int) -> NDArray[np.int64]:
    """(1, 5) the keys that fingers strike, by their names."""
    names = ("thumb", "index", "middle", "ring", "little")
    return np.array([[fingers.get(name, KEYS) for name in names]])


def hand(
    centre: float, keys: dict[int, int] | None = None, since: int = 0, until: int = 0
) -> Fingers:
    """A hand whose fingers pressed keys last, from and until a frame."""
    key, went_down, free = np.full((3, 1, 5), -1)
    free[:] = 0
    for finger, last in (keys or {}).items():
        key[0, finger], went_down[0, finger], free[0, finger] = last, since, until
    return Fingers(key, went_down, free, np.array([centre]))


def over(key: int, finger: int) -> float:
    """Where the relaxed middle finger of a right hand is if a finger is on a key."""
    return float(ALONG[key] - EASE[finger])


def cost(fingers: Fingers, strikes: NDArray[np.int64], what: Struck, **prices: float) -> HandCost:
    return hand_cost(RIGHT, fingers, strikes, what, replace(FREE, **prices))


@pytest.mark.parametrize("at_once", [1, 4])
@pytest.mark.parametrize(
    ("finger", "key", "thumb", "weak"),
    [
        ("thumb", WHITE, 0, 0),
        ("thumb", BLACK_KEY, 1, 0),
        ("index", BLACK_KEY, 0, 0),
        ("middle", WHITE, 0, 0),
        ("ring", WHITE, 0, 1),
        ("little", BLACK_KEY, 0, 1),
    ],
)
def test_thumbs_on_black_keys_and_weak_fingers(
    finger: str, key: int, thumb: int, weak: int, at_once: int
) -> None:
    assert not BLACK[WHITE]
    assert BLACK[BLACK_KEY]
    found = cost(
        hand(ALONG[key]),
        strike(**{finger: key}),
        struck(key, at_once=at_once),
        thumb_on_black=0.2,
        weak_finger=0.1,
    )
    assert found.cost[0, 0] == pytest.approx((0.2 * thumb + 0.1 * weak) / at_once, abs=1e-9)


def test_both_weak_fingers_cost_twice() -> None:
    strikes = strike(ring=WHITE, little=WHITE + 2)
    found = cost(hand(ALONG[WHITE]), strikes, struck(WHITE, WHITE + 2), weak_finger=0.1)
    assert found.cost[0, 0] == pytest.approx(0.2, abs=1e-9)


@pytest.mark.parametrize("rest", [1, 2, 5])
def test_a_finger_that_changes_keys_quickly(rest: int) -> None:
    """`rest` frames after it let go of its last key, and one for the press."""
    idle = hand(over(WHITE, INDEX), {INDEX: WHITE}, until=ONSET - rest)
    prices = {"reuse": 4.0, "late": 1e6}
    for key, wanted in ((WHITE, 0.0), (WHITE + 2, 4.0 / (rest + 1) ** 2)):
        found = cost(idle, strike(index=key), struck(key), **prices)
        assert found.cost[0, 0] == pytest.approx(wanted, abs=1e-6)
    # Another finger has rested all the time.
    found = cost(idle, strike(middle=WHITE + 2), struck(WHITE + 2), **prices)
    assert found.cost[0, 0] == pytest.approx(0.0, abs=1e-6)


def test_the_hop_of_a_finger_is_measured_along_its_hand() -> None:
    """The hand carries it as far as its middle moves; a centimetre up and down is added."""
    rest, speed = 4, 0.3
    still = hand(over(WHITE, INDEX), {INDEX: WHITE}, until=ONSET - rest)
    seconds = (rest + 1) * FRAME_SECONDS
    found = cost(still, strike(index=WHITE + 2), struck(WHITE + 2), hop_speed=speed, late=1e6)
    # Alone it is the whole hand that moves.
    assert found.cost[0, 0] == pytest.approx((0.01 / seconds / speed) ** 2, abs=1e-9)
    assert found.centre[0, 0] == pytest.approx(over(WHITE + 2, INDEX))
    both = strike(index=WHITE + 2, ring=WHITE + 5)
    centre = (over(WHITE + 2, INDEX) + over(WHITE + 5, RING)) / 2
    moved = centre - over(WHITE, INDEX)
    way = abs(ALONG[WHITE + 2] - ALONG[WHITE] - moved) + 0.01
    found = cost(still, both, struck(WHITE + 2, WHITE + 5), hop_speed=speed, late=1e6)
    assert found.centre[0, 0] == pytest.approx(centre)
    assert found.cost[0, 0] == pytest.approx((way / seconds / speed) ** 2, abs=1e-9)


def test_the_travel_of_a_hand_grows_with_the_square_of_its_speed() -> None:
    speed, rest = 0.5, 3
    was = hand(over(WHITE, MIDDLE), {MIDDLE: WHITE}, until=ONSET - rest)
    way = ALONG[FAR] - ALONG[WHITE]
    for first, wanted in ((was, (way / (rest + 1) / FRAME_SECONDS / speed) ** 2),):
        found = cost(first, strike(middle=FAR), struck(FAR), travel_speed=speed, late=1e6)
        assert found.cost[0, 0] == pytest.approx(wanted)
        assert found.early[0, 0] == found.late[0, 0] == 0
    # Each note pays.
    two = strike(middle=FAR, ring=FAR + 2)
    centre = (over(FAR, MIDDLE) + over(FAR + 2, RING)) / 2
    way = centre - over(WHITE, MIDDLE)
    found = cost(was, two, struck(FAR, FAR + 2), travel_speed=speed, late=1e6)
    assert found.cost[0, 0] == pytest.approx(2 * (way / (rest + 1) / FRAME_SECONDS / speed) ** 2)


def test_the_first_way_of_a_hand_costs_half_of_a_dropped_note_at_most() -> None:
    found = cost(hand(-0.5), strike(middle=80), struck(80), travel_speed=0.1, drop=4.0, late=1e6)
    assert found.cost[0, 0] == pytest.approx(2.0)


def test_arriving_late_costs_its_frames_and_its_price() -> None:
    """The cheapest of 0 to 4 frames is taken."""
    speed, rest, price = 0.5, 1, 0.5
    was = hand(over(WHITE, MIDDLE), {MIDDLE: WHITE}, until=ONSET - rest)
    way = ALONG[FAR] - ALONG[WHITE]
    ways = [
        (way / (rest + late + 1) / FRAME_SECONDS / speed) ** 2 + late + price * (late > 0)
        for late in range(5)
    ]
    assert 0 < np.argmin(ways) < 4
    config = {"travel_speed": speed, "late": price}
    # The note before is too short to be left early: it would be gone.
    was = was._replace(since=np.where(was.key >= 0, ONSET - rest - 1, -1))
    found = cost(was, strike(middle=FAR), struck(FAR), **config)
    assert found.late[0, 0] == np.argmin(ways)
    assert found.cost[0, 0] == pytest.approx(min(ways))
    # A note is not begun after its end.
    found = cost(was, strike(middle=FAR), struck(FAR, lasts=1), **config)
    assert found.late[0, 0] == 0


def test_leaving_early_costs_the_frames_of_the_note_that_is_left() -> None:
    speed = 0.5
    was = hand(over(WHITE, MIDDLE), {MIDDLE: WHITE}, since=0, until=ONSET)
    way = ALONG[FAR] - ALONG[WHITE]
    ways = [(way / (early + 1) / FRAME_SECONDS / speed) ** 2 + early for early in range(4)]
    found = cost(was, strike(middle=FAR), struck(FAR), travel_speed=speed, late=1e6)
    assert found.early[0, 0] == np.argmin(ways) > 0
    assert found.cost[0, 0] == pytest.approx(min(ways))


def test_releasing_a_held_note_costs_its_frames_and_its_price() -> None:
    held = hand(over(WHITE, MIDDLE), {MIDDLE: WHITE}, since=0, until=ONSET + 6)
    found = cost(held, strike(middle=WHITE + 2), struck(WHITE + 2), cut=0.5, late=1e6)
    assert found.cost[0, 0] == pytest.approx(6 + 0.5, abs=1e-6)
    assert found.let_go[0, 0, MIDDLE]
    # A finger that need not move goes on holding.
    found = cost(held, strike(ring=WHITE + 2), struck(WHITE + 2), cut=0.5, late=1e6)
    assert found.cost[0, 0] == pytest.approx(0.0, abs=1e-6)
    assert not found.let_go[0, 0, MIDDLE]


@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_stretch_is_the_fourth_power_and_strain_the_square_of_the_reach(side: int) -> None:
    keys = (51, 55, 58) if side == RIGHT else (58, 55, 51)
    strikes = np.array([[keys[0], KEYS, keys[1], KEYS, keys[2]]])
    share = stretch(side)
    shares = np.array(
        [
            share[THUMB, MIDDLE, keys[0], keys[1]],
            share[THUMB, LITTLE, keys[0], keys[2]],
            share[MIDDLE, LITTLE, keys[1], keys[2]],
        ]
    )
    assert (shares > 0).all()
    for strain, limit in ((1.0, 0.0), (0.0, 1.0), (1.0, 4.0)):
        config = replace(FREE, strain=max(strain, 1e-12), stretch=max(limit, 1e-12))
        wanted = (strain * shares**2 + limit * shares**4).sum()
        assert chord_cost(side, strikes, config)[0] == pytest.approx(wanted, abs=1e-9)
    wide = np.array([[0, KEYS, KEYS, KEYS, 40]])
    assert chord_cost(side, wide, FREE)[0] == np.inf


def test_only_the_thumb_crosses_where_fingers_are_in_each_others_way() -> None:
    """Laws: what is in reach without crossing costs the same; crossed fingers are out of reach."""
    for side in (LEFT, RIGHT):
        any_order, own_order = (pair_cost(side, 1.0, 4.0, crossing) for crossing in (True, False))
        same = np.isfinite(own_order)
        np.testing.assert_array_equal(own_order[same], any_order[same])
        low, high = (51, 53) if side == RIGHT else (53, 51)
        assert np.isfinite(own_order[MIDDLE, RING, low, high])
        assert np.isfinite(any_order[MIDDLE, RING, high, low])
        assert np.isinf(own_order[MIDDLE, RING, high, low])
        assert np.isfinite(own_order[THUMB, RING, high, low])
        semitones = own_order[MIDDLE, RING, np.arange(87), np.arange(1, 88)]
        if side == RIGHT:
            assert np.isfinite(semitones).all()


def test_hands_do_not_come_close_where_it_costs() -> None:
    """Two keys side by side, in the middle: without the price each hand takes one."""
    score = score_of((49, 4, 9), (48, 9, 22))
    assert find_fingering(score, FingeringConfig(crossed=0.0)).hand.tolist() == [RIGHT, LEFT]
    assert find_fingering(score, FingeringConfig()).hand.tolist() == [RIGHT, RIGHT]
    assert find_fingering(score, FingeringConfig(apart=0.0)).hand.tolist() == [RIGHT, LEFT]


def test_a_note_that_costs_more_than_it_is_worth_is_left_out() -> None:
    """Its worth: the price of a dropped note, and its frames."""
    score = score_of((20, 4, 8), (32, 4, 8), (44, 4, 8), (56, 4, 8), (68, 4, 8), (80, 4, 8))
    few = find_fingering(score, FingeringConfig(drop=0.0, stretch=400.0))
    many = find_fingering(score, FingeringConfig(drop=4000.0, stretch=400.0))
    assert (few.hand < 0).sum() > (many.hand < 0).sum()


def test_the_value_of_a_key_is_its_share_of_the_recall() -> None:
    score = score_of((40, 1, 8), (50, 2, 5), (60, 2, 5), (70, 2, 4))
    value = np.diff(frame_values(score, FingeringConfig()))
    np.testing.assert_allclose(value[:6], [1, 1, 1 / 4, 1 / 4, 1 / 3, 1])
    assert len(value) == score.frames() + 5


def test_frames_have_a_price_and_another_under_the_pedal() -> None:
    score = replace(score_of((40, 0, 8), (50, 0, 8)), pedal=np.array([[0.2, 0.3]]))
    value = np.diff(frame_values(score, FingeringConfig(frame=0.2, pedalled=0.5)))
    pedal = score.pedal_roll()
    assert pedal.any()
    assert not pedal.all()
    np.testing.assert_allclose(value[:8], np.where(pedal, 0.05, 0.1)[:8])


def test_the_frames_of_one_note_cost_so_much_at_most() -> None:
    held = hand(over(WHITE, MIDDLE), {MIDDLE: WHITE}, since=0, until=ONSET + 6)
    strikes, what = strike(middle=WHITE + 2), struck(WHITE + 2)
    found = cost(held, strikes, what, cut=0.5, late=1e6, most_frames=2.0)
    assert found.cost[0, 0] == pytest.approx(2 + 0.5, abs=1e-6)


@pytest.mark.parametrize("most", [0, 2, 9])
def test_a_hand_leaves_so_early_at_most(most: int) -> None:
    was = hand(over(WHITE, MIDDLE), {MIDDLE: WHITE}, since=0, until=ONSET)
    prices = {"travel_speed": 0.01, "late": 1e6, "early": most}
    found = cost(was, strike(middle=FAR), struck(FAR), **prices)
    assert found.early[0, 0] == most


def test_out_of_reach_is_out_of_reach_at_any_price() -> None:
    """Also where stretched fingers cost nothing."""
    free, usual = pair_cost(RIGHT, 0.0, 0.0), pair_cost(RIGHT, 1.0, 4.0)
    np.testing.assert_array_equal(np.isinf(free), np.isinf(usual))
    assert np.isinf(usual).any()
    assert not np.isnan(free).any()
