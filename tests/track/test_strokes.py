"""Strokes: where fingertips are, how fast and with what force, and that strikes' wishes are met."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.plan.strikes import Strikes
from pianomime.track.strokes import Corrections, StrokeConfig, Strokes, strokes_of
from pianomime.world.key_sensor import sounds_at
from pianomime.world.parameters import PARAMETERS, key_levers, key_travel
from pianomime.world.touch import TOUCHES

DT = 0.0005
"""[s] Fine enough to differentiate; the tracker's own steps are twenty times as long."""
CONFIG = StrokeConfig()
WHITE, BLACK = 39, 40
RIGHT, INDEX = 1, 1
BETWEEN = 70
"""A velocity whose strokes are neither as long nor as short as they may be."""


def strikes_at(
    onset: list[float],
    velocity: int | list[int] = BETWEEN,
    key: int | list[int] = WHITE,
    finger: int | list[int] = INDEX,
    lasts: float = 0.3,
) -> Strikes:
    def each(value: int | list[int]) -> NDArray[np.int64]:
        return np.broadcast_to(np.array(value), len(onset)).copy()

    begin = np.array(onset)
    return Strikes(
        note=np.arange(len(onset)),
        hand=each(RIGHT),
        finger=each(finger),
        key=each(key),
        onset=begin,
        release=begin + lasts,
        velocity=each(velocity),
        outer=np.ones(len(onset), bool),
    )


def times(seconds: float, dt: float = DT) -> NDArray[np.float64]:
    return np.arange(1, round(seconds / dt) + 1) * dt


def made(
    strikes: Strikes,
    config: StrokeConfig = CONFIG,
    advance: float = 0.0,
    speed: float = 1.0,
    at: NDArray[np.float64] | None = None,
    share: float = 0.7,
) -> Strokes:
    """With fingers at one place of all keys, as a share of their length."""
    count = len(strikes)
    corrections = Corrections(np.full(count, advance), np.full(count, speed))
    reach = share * key_levers()[strikes.key]
    at = times(1.0) if at is None else at
    return strokes_of(strikes, corrections, reach, at, config)


def front_depth(
    strokes: Strokes, config: StrokeConfig = CONFIG, share: float = 0.7
) -> NDArray[np.float64]:
    """(n,) What the finger pushes its key's front edge down by, as if it were in no one's way."""
    busy = strokes.strike[:, RIGHT, INDEX] >= 0
    return np.where(busy, config.gap - strokes.height[:, RIGHT, INDEX], 0.0) / share


@pytest.mark.parametrize("key", [0, WHITE, BLACK, 87])
@pytest.mark.parametrize("share", [0.5, 0.7, 0.95])
@pytest.mark.parametrize("velocity", [60, BETWEEN, 90])
def test_a_key_sounds_at_its_onset_as_fast_as_wanted(key: int, share: float, velocity: int) -> None:
    onset = 0.4
    depth = front_depth(made(strikes_at([onset], velocity, key), share=share), share=share)
    at = times(1.0)
    assert np.interp(onset, at, depth) == pytest.approx(
        sounds_at()[key] * key_levers()[key], rel=1e-3
    )
    speed = np.diff(depth) / DT
    wanted = TOUCHES[CONFIG.touch].speed_of(velocity, key)
    around = round(onset / DT) - 1
    np.testing.assert_allclose(speed[around - 1 : around + 1], wanted, rtol=0.01)


def test_a_stroke_is_accelerated_evenly_from_rest() -> None:
    strokes = made(strikes_at([0.4]))
    depth = front_depth(strokes)
    at = times(1.0)
    moves = (depth > 0) & (at < 0.4)
    bend = np.diff(depth[moves], n=2)
    np.testing.assert_allclose(bend, bend.mean(), rtol=1e-6)
    # Before, it waits over its key.
    begun = strokes.strike[:, RIGHT, INDEX] >= 0
    waits = begun & ~moves & (at < 0.4)
    assert waits.sum() * DT == pytest.approx(CONFIG.settle, abs=2 * DT)
    assert (strokes.height[waits, RIGHT, INDEX] == CONFIG.gap).all()
    assert not strokes.force[waits].any()


@pytest.mark.parametrize(
    ("velocity", "lasts"), [(1, CONFIG.longest), (127, CONFIG.shortest)], ids=["soft", "loud"]
)
def test_the_softest_and_the_loudest_are_bounded(velocity: int, lasts: float) -> None:
    depth = front_depth(made(strikes_at([0.4], velocity)))
    at = times(1.0)
    down = at[depth > 1e-9]
    assert 0.4 - down[0] == pytest.approx(lasts, abs=3 * DT)
    sounds = sounds_at()[WHITE] * key_levers()[WHITE]
    assert np.interp(0.4, at, depth) == pytest.approx(sounds, rel=0.01)


def test_louder_is_later_and_faster() -> None:
    began, fast = [], []
    for velocity in (50, 60, 70, 80, 90):
        depth = front_depth(made(strikes_at([0.4], velocity)))[: round(0.45 / DT)]
        began.append(times(0.45)[depth > 1e-9][0])
        fast.append(np.diff(depth).max())
    assert (np.diff(began) > 0).all()
    assert (np.diff(fast) > 0).all()


def test_the_key_is_held_until_it_is_let_go_and_then_the_finger_is_lifted() -> None:
    strikes = strikes_at([0.3])
    strokes, at = made(strikes), times(1.0)
    release = strikes.release[0]
    height = strokes.height[:, RIGHT, INDEX]
    force = strokes.force[:, RIGHT, INDEX]
    held = (at > 0.3 + CONFIG.depth / 0.1) & (at <= release)
    assert held.any()
    np.testing.assert_allclose(height[held], CONFIG.gap - CONFIG.depth)
    np.testing.assert_allclose(force[held], CONFIG.force)
    mine = np.flatnonzero(strokes.strike[:, RIGHT, INDEX] >= 0)
    assert at[mine[-1]] == pytest.approx(release + CONFIG.rise)
    assert height[mine[-1]] == pytest.approx(CONFIG.lift)
    leaves = (at > release) & (at <= at[mine[-1]])
    assert (np.diff(height[leaves]) > 0).all()
    assert not force[leaves].any()


@pytest.mark.parametrize("key", [0, WHITE, BLACK])
@pytest.mark.parametrize("velocity", [1, BETWEEN, 127])
def test_fingers_never_pull(key: int, velocity: int) -> None:
    strikes = strikes_at([0.3, 0.55], velocity, key, lasts=0.15)
    for dt in (DT, 0.01):
        strokes = made(strikes, at=times(1.0, dt))
        assert (strokes.force >= 0).all()
        assert (strokes.force[strokes.strike < 0] == 0).all()
        assert strokes.force.max() > 1


def test_the_force_of_a_stroke_is_what_the_key_resists() -> None:
    """By hand, half way down: the key's spring, its damper, and the mass that is accelerated."""
    strikes = strikes_at([0.4])
    strokes, at = made(strikes), times(1.0)
    reach = 0.7 * key_levers()[WHITE]
    sounds = sounds_at()[WHITE] * reach
    speed = 0.7 * float(CONFIG.speeds(strikes)[0])
    lasts = 2 * sounds / speed
    middle = int(np.argmin(np.abs(at - (0.4 - lasts / 2))))
    joint = PARAMETERS["keyboard"]["joint"]
    since = at[middle] - (0.4 - lasts)
    turned = speed / lasts * since**2 / 2 / reach
    turning = speed / lasts * since / reach
    torque = joint["stiffness"] * (turned - joint["springref"]) + joint["damping"] * turning
    wanted = torque / reach + CONFIG.mass * speed / lasts
    assert strokes.force[middle, RIGHT, INDEX] == pytest.approx(wanted, rel=1e-6)
    assert turned < key_travel()[WHITE]


def test_the_stroke_itself_is_exact() -> None:
    strokes, at = made(strikes_at([0.4])), times(1.0)
    tight = strokes.tight[:, RIGHT, INDEX]
    depth = front_depth(strokes)
    np.testing.assert_array_equal(tight[at < 0.4], depth[at < 0.4] > 0)
    assert at[tight].max() == pytest.approx(0.41, abs=2 * DT)
    assert not strokes.tight[strokes.strike < 0].any()


def test_of_two_strikes_of_a_finger_the_later_begins_when_it_begins() -> None:
    strokes, at = made(strikes_at([0.3, 0.5], lasts=0.3)), times(1.0)
    strike = strokes.strike[:, RIGHT, INDEX]
    assert strike[at < 0.3][-1] == 0
    assert strike[at < 0.5][-1] == 1
    changes = strike[np.flatnonzero(np.diff(strike))]
    assert changes.tolist() == [-1, 0, 1]
    # It is over its key again before it strikes it again.
    begins = np.flatnonzero(strike == 1)[0]
    assert strokes.height[begins, RIGHT, INDEX] == CONFIG.gap


def test_fingers_move_by_themselves() -> None:
    both = strikes_at([0.3, 0.32], finger=[INDEX, 4], key=[WHITE, 46])
    strokes = made(both)
    alone = made(strikes_at([0.3]))
    np.testing.assert_array_equal(strokes.height[:, RIGHT, INDEX], alone.height[:, RIGHT, INDEX])
    busy = np.argwhere((strokes.strike >= 0).any(axis=0))
    np.testing.assert_array_equal(busy, [[RIGHT, INDEX], [RIGHT, 4]])


def test_corrections_shift_and_hasten() -> None:
    plain, at = made(strikes_at([0.4])), times(1.0)
    sounds = sounds_at()[WHITE] * key_levers()[WHITE]
    depth = front_depth(plain)
    earlier = front_depth(made(strikes_at([0.4]), advance=0.02))
    later = front_depth(made(strikes_at([0.4]), advance=-0.02))
    goes_down = at < 0.45
    for each, when in ((depth, 0.4), (earlier, 0.38), (later, 0.42)):
        found = np.interp(sounds, each[goes_down], at[goes_down])
        assert found == pytest.approx(when, abs=DT)
    faster = front_depth(made(strikes_at([0.4]), speed=1.2))
    assert np.interp(0.4, at, faster) == pytest.approx(sounds, rel=1e-3)
    assert np.diff(faster[goes_down]).max() / np.diff(depth[goes_down]).max() == pytest.approx(
        1.2, rel=0.01
    )


def test_a_key_is_let_go_when_it_is_to_however_it_is_corrected() -> None:
    strokes = [made(strikes_at([0.4]), advance=advance) for advance in (-0.02, 0.0, 0.02)]
    ends = {np.flatnonzero(each.strike[:, RIGHT, INDEX] >= 0)[-1] for each in strokes}
    assert len(ends) == 1


@pytest.mark.parametrize("controls", [1, 2, 5, 10])
def test_coarse_steps_are_the_fine_ones_looked_at_less_often(controls: int) -> None:
    fine, coarse = made(strikes_at([0.3])), made(strikes_at([0.3]), at=times(1.0, 0.05 / controls))
    every = round(0.05 / controls / DT)
    mine = (coarse.strike >= 0) & (fine.strike[every - 1 :: every] >= 0)
    mine &= times(1.0, 0.05 / controls)[:, None, None] < 0.55
    assert mine.sum() > 3
    for name in ("height", "force"):
        np.testing.assert_allclose(
            getattr(coarse, name)[mine], getattr(fine, name)[every - 1 :: every][mine], atol=1e-9
        )


def test_strikes_at_both_ends_of_a_plan_have_what_there_is_time_for() -> None:
    strokes = made(strikes_at([0.0, 0.99]))
    assert strokes.strike[0, RIGHT, INDEX] == 0
    assert strokes.strike[-1, RIGHT, INDEX] == 1
    beyond = made(strikes_at([2.0]))
    assert not (beyond.strike >= 0).any()
    assert not beyond.height.any()


def test_even_touch_is_one_speed() -> None:
    strikes = strikes_at([0.2, 0.4, 0.6], [30, 64, 120])
    even = replace(CONFIG, even=True).speeds(strikes)
    np.testing.assert_array_equal(even, CONFIG.speeds(strikes)[1])
    assert (np.diff(CONFIG.speeds(strikes)) > 0).all()


def test_touches_are_other_speeds() -> None:
    strikes = strikes_at([0.2], 90)
    other = replace(CONFIG, touch="cantabile").speeds(strikes)
    np.testing.assert_array_equal(other, TOUCHES["cantabile"].speed_of(90, WHITE))
    assert other[0] != CONFIG.speeds(strikes)[0]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"touch": "heavy"}, "touch must be one of goebl-bresin, cantabile, not 'heavy'"),
        ({"longest": 0.0}, "longest must be more than 0"),
        ({"shortest": 0.0}, "shortest must be more than 0"),
        ({"longest": 0.01, "shortest": 0.02}, "shortest must be 0 to 0.01"),
        ({"ramp": 0.0}, "ramp must be more than 0"),
        ({"rise": 0.0}, "rise must be more than 0"),
        ({"settle": -0.1}, "settle must be 0 or more"),
        ({"force": np.inf}, "force must be 0 or more"),
        ({"lift": np.nan}, "lift must be 0 or more"),
    ],
)
def test_settings_that_cannot_be_are_refused(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        StrokeConfig(**wrong)
