"""What an ear minds, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_SECONDS, KEYS
from pianomime.plan.strikes import Strikes
from pianomime.track.heard import Frame, Strike, strikes_in
from pianomime.track.sampling.note_cost import NoteCost, NoteCostConfig
from pianomime.world.key_sensor import NOTHING, KeyEvents
from pianomime.world.touch import TOUCHES

CONFIG = NoteCostConfig()
TOUCH = TOUCHES["goebl-bresin"]
FRAMES = 20
VELOCITY = 70
OUTER, INNER = 40, 44


def wanted(key: list[int], onset: list[float], velocity: int = VELOCITY) -> Strikes:
    """Of which those of the key `INNER` are inner notes."""
    count = len(key)
    begin = np.array(onset)
    return Strikes(
        note=np.arange(count),
        hand=np.ones(count, int),
        finger=np.ones(count, int),
        key=np.array(key, int),
        onset=begin,
        release=begin + 0.2,
        velocity=np.full(count, velocity),
        outer=np.array(key, int) != INNER,
    )


def cost_of(strikes: Strikes, config: NoteCostConfig = CONFIG, goal: bool = False) -> NoteCost:
    """Where no key, or every one, should be down."""
    return NoteCost(strikes, np.full((FRAMES, KEYS), goal), TOUCH, config)


def heard(
    strikes: list[Strike], first: int = 0, frames: int = FRAMES, down: bool = False
) -> list[Frame]:
    """Frames in which these sound, and no key, or every one, is down."""
    made = []
    for number in range(first, first + frames):
        mine = [one for one in strikes if int(one.time / FRAME_SECONDS) == number]
        made.append(Frame(mine, np.full(KEYS, down)))
    return made


def struck(key: int, time: float, velocity: int = VELOCITY) -> Strike:
    return Strike(key, time, float(TOUCH.speed_of(velocity, key)))


def perfect(strikes: Strikes) -> list[Strike]:
    columns = (strikes.key, strikes.onset, strikes.velocity)
    return [struck(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]


BOTH = wanted([OUTER, INNER], [0.12, 0.33])


def total(strikes: list[Strike], config: NoteCostConfig = CONFIG) -> float:
    return cost_of(BOTH, config).of(0, heard(strikes), FRAMES)[0]


@settings(max_examples=50, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(30, 34), st.integers(0, 90)), min_size=1, max_size=20, unique=True
    )
)
def test_perfect_playing_costs_nothing(notes: list[tuple[int, int]]) -> None:
    notes.sort(key=lambda note: note[1])
    strikes = wanted([key for key, _ in notes], [at / 100 for _, at in notes])
    cost, wrong = cost_of(strikes).of(0, heard(perfect(strikes)), FRAMES)
    assert cost == 0
    assert not wrong


def test_an_outer_note_is_missed_more_than_a_phantom_and_that_more_than_an_inner_one() -> None:
    outer, inner = perfect(BOTH)
    assert total([outer, inner]) == 0
    assert total([outer]) == 1
    assert total([inner]) == CONFIG.outer
    phantom = total([outer, inner, struck(60, 0.5)])
    assert phantom == CONFIG.phantom
    assert 1 < phantom < CONFIG.outer
    assert total([]) == CONFIG.outer + 1


@pytest.mark.parametrize("late", [0.0, 0.007, 0.02, 0.048, 0.06, 0.1])
@pytest.mark.parametrize("sign", [-1, 1])
def test_time(late: float, sign: int) -> None:
    outer, inner = perfect(BOTH)
    off = [outer._replace(time=outer.time + sign * late), inner]
    share = min(max(late - 0.008, 0) / 0.04, 1.5)
    assert total(off) == pytest.approx(CONFIG.late * share)
    assert total(off) < 1


@pytest.mark.parametrize("steps", [-60, -16, -10, -4, 0, 3, 5, 16, 40])
def test_touch(steps: int) -> None:
    outer, inner = perfect(BOTH)
    off = struck(OUTER, outer.time, VELOCITY + steps)
    share = min(max(abs(steps) - 4, 0) / 12, 1.5)
    assert total([off, inner]) == pytest.approx(CONFIG.touch * share)


def test_each_cost_is_in_proportion_to_its_setting() -> None:
    outer, inner = perfect(BOTH)
    playing = {
        "late": [outer._replace(time=outer.time + 0.03), inner],
        "touch": [struck(OUTER, outer.time, VELOCITY + 12), inner],
        "phantom": [outer, inner, struck(60, 0.5)],
        "outer": [inner],
    }
    for name, strikes in playing.items():
        twice = replace(CONFIG, **{name: 2 * getattr(CONFIG, name)})
        assert total(strikes) > 0
        assert total(strikes, twice) == pytest.approx(2 * total(strikes))


def test_a_strike_far_from_its_note_is_a_phantom_and_the_note_is_missed() -> None:
    outer, inner = perfect(BOTH)
    near, far = (outer._replace(time=outer.time + apart) for apart in (0.11, 0.13))
    assert total([near, inner]) < 1
    assert total([far, inner]) == pytest.approx(CONFIG.phantom + CONFIG.outer)


def test_a_note_is_struck_once() -> None:
    outer, inner = perfect(BOTH)
    again = outer._replace(time=outer.time + 0.04)
    cost, wrong = cost_of(BOTH).of(0, heard([outer, again, inner]), FRAMES)
    assert cost == CONFIG.phantom
    assert wrong == [(3, OUTER)]


def test_two_notes_of_a_key_need_two_strikes() -> None:
    strikes = wanted([OUTER, OUTER], [0.12, 0.22])
    both = perfect(strikes)
    assert cost_of(strikes).of(0, heard(both), FRAMES)[0] == 0
    for one in both:
        assert cost_of(strikes).of(0, heard([one]), FRAMES)[0] == CONFIG.outer


def test_another_key_is_another_note() -> None:
    outer, inner = perfect(BOTH)
    assert total([outer._replace(key=OUTER + 1), inner]) == CONFIG.phantom + CONFIG.outer


def test_what_was_heard_before_is_neither_missed_nor_struck_again() -> None:
    outer, inner = perfect(BOTH)
    cost = cost_of(BOTH)
    # It sounds at 0.12 s; frame 3 begins at 0.15 s, and until 0.17 s it might still come.
    assert cost.of(3, heard([inner], 3, 8), 8)[0] == CONFIG.outer
    late = outer._replace(time=0.155)
    assert cost.of(3, heard([late, inner], 3, 8), 8)[0] < 1
    cost.heard([outer])
    assert cost.of(3, heard([inner], 3, 8), 8)[0] == 0
    assert cost.of(3, heard([late, inner], 3, 8), 8)[0] == CONFIG.phantom
    # What was heard and not wanted changes nothing.
    cost.heard([struck(60, 0.2)])
    assert cost.of(3, heard([inner], 3, 8), 8)[0] == 0


def test_what_is_long_past_is_no_cost_any_more() -> None:
    assert cost_of(BOTH).of(4, heard([perfect(BOTH)[1]], 4, 8), 8)[0] == 0


def test_to_ask_changes_nothing() -> None:
    cost = cost_of(BOTH)
    playing = heard(perfect(BOTH)[:1])
    assert cost.of(0, playing, FRAMES) == cost.of(0, playing, FRAMES)


def test_only_the_frames_that_count_cost_but_late_strikes_are_waited_for() -> None:
    outer, _ = perfect(BOTH)
    phantom = struck(60, 0.32)
    # The inner note is at 0.33 s, in frame 6.
    assert cost_of(BOTH).of(0, heard([outer, phantom]), 6)[0] == 0
    assert cost_of(BOTH).of(0, heard([outer, phantom]), 8)[0] == CONFIG.phantom + 1
    # The outer note at 0.12 s comes in frame 3, after the three that count.
    late = outer._replace(time=0.155)
    assert cost_of(wanted([OUTER], [0.105])).of(0, heard([late]), 3)[0] == 0
    assert cost_of(wanted([OUTER], [0.105])).of(0, heard([]), 3)[0] == CONFIG.outer
    # Just before the end of what is looked at, nothing is missed yet.
    assert cost_of(wanted([OUTER], [0.14])).of(0, heard([], frames=3), 3)[0] == 0


def test_what_goes_wrong_is_named() -> None:
    outer, inner = perfect(BOTH)
    late = inner._replace(time=inner.time + 0.06)
    cost = cost_of(BOTH)
    assert cost.of(0, heard([inner]), FRAMES)[1] == [(2, OUTER)]
    assert cost.of(0, heard([outer, late]), FRAMES)[1] == [(7, INNER)]
    assert cost.of(0, heard([outer, inner, struck(60, 0.5)]), FRAMES)[1] == [(10, 60)]
    little = inner._replace(time=inner.time + 0.015)
    assert not cost.of(0, heard([outer, little]), FRAMES)[1]
    # Frames are counted from the first, also of a note that should have come before it.
    assert cost.of(3, heard([inner], 3, 8), 8)[1] == [(0, OUTER)]
    assert cost.of(2, heard([outer], 2, 8), 8)[1] == [(4, INNER)]


@pytest.mark.parametrize("goal", [False, True])
def test_keys_at_the_ends_of_frames(goal: bool) -> None:
    silent = wanted([], [])
    cost = cost_of(silent, goal=goal)
    right, wrong = heard([], down=goal), heard([], down=goal)
    wrong[4].pressed[[10, 20]] ^= True
    assert cost.of(0, right, FRAMES) == (0, [])
    found, named = cost.of(0, wrong, FRAMES)
    assert found == pytest.approx(2 * CONFIG.frame)
    assert not named
    assert cost.of(0, wrong, 4)[0] == 0


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from([OUTER, INNER]), st.integers(0, 90)), max_size=8),
    st.lists(st.tuples(st.sampled_from([OUTER, INNER]), st.integers(0, 90)), max_size=8),
)
def test_one_strike_is_one_note(
    notes: list[tuple[int, int]], playing: list[tuple[int, int]]
) -> None:
    """With missed notes and phantoms alone, costs count what is left over on each side."""
    notes.sort(key=lambda note: note[1])
    playing.sort(key=lambda note: note[1])
    config = replace(CONFIG, outer=1.0, phantom=1.0, late=0.0, touch=0.0, match=10.0)
    strikes = wanted([key for key, _ in notes], [at / 100 for _, at in notes])
    found = cost_of(strikes, config).of(
        0, heard([struck(key, at / 100) for key, at in playing]), 20
    )
    left = 0
    for key in (OUTER, INNER):
        left += abs(sum(each == key for each, _ in notes) - sum(each == key for each, _ in playing))
    assert found[0] == left


def events(rows: list[tuple[int, int, bool, float, float]]) -> KeyEvents:
    columns: list[NDArray] = [np.array(column) for column in zip(*rows, strict=True)]
    return KeyEvents(*columns)


def test_strikes_are_the_note_ons_of_a_world() -> None:
    rows = [
        (0, 40, True, 0.01, 0.3),
        (0, 41, False, 0.012, -0.1),
        (1, 42, True, 0.02, 0.5),
        (0, 43, True, 0.03, 0.4),
    ]
    found = strikes_in(events(rows), 2.0)
    assert found == [Strike(40, 2.01, 0.3), Strike(43, 2.03, 0.4)]
    assert strikes_in(events(rows), 2.0, 1) == [Strike(42, 2.02, 0.5)]
    assert strikes_in(NOTHING, 2.0) == []


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"match": 0.0}, "match must be more than 0"),
        ({"phantom": -1.0}, "phantom must be 0 or more"),
        ({"late": np.nan}, "late must be 0 or more"),
    ],
)
def test_settings_that_cannot_be_are_refused(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        NoteCostConfig(**wrong)
