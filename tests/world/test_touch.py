"""Touch: points that papers give, there and back again, and what is no strike."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pianomime.keyboard import BLACK, KEYS
from pianomime.world.model import world_model
from pianomime.world.parameters import key_levers
from pianomime.world.touch import LOUDEST, SOFTEST, TOUCHES, AngularTouch, HammerTouch, Touch

every_touch = pytest.mark.parametrize("touch", TOUCHES.values(), ids=TOUCHES)
keys = st.integers(0, KEYS - 1)


@pytest.mark.parametrize(
    ("hammer", "velocity"),
    # Goebl and Bresin 2003; Goebl, Bresin and Galembo 2005, who round.
    [(2.0, 77), (0.7, 40), (1.25, 60)],
)
def test_hammers_have_the_velocities_of_the_papers(hammer: float, velocity: int) -> None:
    touch = TOUCHES["goebl-bresin"]
    assert isinstance(touch, HammerTouch)
    found = touch.velocity_of(hammer / 5, 39)
    assert abs(int(found) - velocity) <= 1


def test_velocities_of_cantabile_are_linear_in_the_angle() -> None:
    touch = TOUCHES["cantabile"]
    white, black = np.flatnonzero(~BLACK)[0], np.flatnonzero(BLACK)[0]
    for key, lever in ((white, 0.15), (black, 0.09)):
        speeds = np.array([0.39, (0.39 + 8) / 2, 8.0]) * lever
        assert touch.velocity_of(speeds, key).tolist() == [1, 64, 127]


def test_the_front_edge_is_where_the_model_has_it() -> None:
    model = world_model()
    data = mujoco.MjData(model)
    for key in (0, 1, 40, 87):
        joint = model.joint(f"key_{key}")
        data.qvel[:] = 0
        data.qvel[joint.dofadr[0]] = 1.0
        mujoco.mj_forward(model, data)
        body, half = model.body(f"key_{key}").id, model.geom(f"key_{key}").size
        front = data.xpos[body] + [half[0], 0, 0]
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jacobian, None, front, body)
        # At one radian a second the edge moves by its distance from the hinge.
        assert -(jacobian @ data.qvel)[2] == pytest.approx(key_levers()[key])


@every_touch
@given(velocity=st.integers(SOFTEST, LOUDEST), key=keys)
def test_there_and_back_again(touch: Touch, velocity: int, key: int) -> None:
    assert touch.velocity_of(touch.speed_of(velocity, key), key) == velocity


@every_touch
@given(one=st.floats(-1, 10), other=st.floats(-1, 10), key=keys)
def test_a_faster_key_is_never_softer(touch: Touch, one: float, other: float, key: int) -> None:
    slow, fast = sorted((one, other))
    low, high = touch.velocity_of([slow, fast], key)
    assert SOFTEST <= low <= high <= LOUDEST


@every_touch
def test_arrays_give_what_their_elements_give(touch: Touch) -> None:
    speeds, some = np.array([0.1, 0.5, 0.9]), np.array([0, 1, 87])
    assert touch.velocity_of(speeds[:, None], some).shape == (3, 3)
    each = [int(touch.velocity_of(speed, key)) for speed, key in zip(speeds, some, strict=True)]
    assert touch.velocity_of(speeds, some).tolist() == each
    assert touch.velocity_of([], np.array([], np.int64)).shape == (0,)


@every_touch
def test_what_is_no_strike_is_refused(touch: Touch) -> None:
    for speed in (np.nan, np.inf):
        with pytest.raises(ValueError, match="finite"):
            touch.velocity_of(speed, 0)
    for key in (-1, KEYS):
        with pytest.raises(ValueError, match="keys"):
            touch.velocity_of(0.5, key)
    for velocity in (0, LOUDEST + 1, np.nan):
        with pytest.raises(ValueError, match="velocities"):
            touch.speed_of(velocity, 0)


def test_maps_that_do_not_grow_are_refused() -> None:
    with pytest.raises(ValueError, match="positive"):
        HammerTouch(hammer_ratio=0.0)
    with pytest.raises(ValueError, match="ends"):
        AngularTouch(slowest=8.0, fastest=0.39)
