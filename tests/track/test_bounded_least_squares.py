"""Many bounded least-squares programs at once, by either solver, against scipy one by one."""

from __future__ import annotations

import daqp
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from pianomime.track.ik import bounded_least_squares

JOINTS, ROWS = 9, 12


@pytest.mark.parametrize("solver", ["fast", "slow"])
@pytest.mark.parametrize("shape", [(), (4,), (2, 3)])
def test_each_of_many_is_its_own_program(
    solver: str, shape: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(0)
    jacobian, error = rng.normal(size=(*shape, ROWS, JOINTS)), rng.normal(size=(*shape, ROWS))
    damping = rng.uniform(1e-3, 1.0, shape)
    low = -rng.uniform(0.0, 0.1, (*shape, JOINTS))
    high = rng.uniform(0.0, 0.1, (*shape, JOINTS))
    if solver == "slow":
        given_up = np.full(JOINTS, np.nan), 0.0, -1, {}
        monkeypatch.setattr(daqp, "solve", lambda *_: given_up)
    found = bounded_least_squares(jacobian, error, damping, low, high)
    assert found.shape == (*shape, JOINTS)
    bound = 0
    for index in np.ndindex(shape):
        rows = np.vstack([jacobian[index], np.sqrt(damping[index]) * np.eye(JOINTS)])
        wanted = np.concatenate([error[index], np.zeros(JOINTS)])
        theirs = lsq_linear(rows, wanted, (low[index], high[index]), tol=1e-12).x
        np.testing.assert_allclose(found[index], theirs, atol=1e-5)
        bound += np.isclose(theirs, low[index]).sum() + np.isclose(theirs, high[index]).sum()
    assert bound > 0


def test_a_joint_without_room_stays_where_it_is() -> None:
    rng = np.random.default_rng(1)
    low = np.full(JOINTS, -1.0)
    high = -low
    low[2] = high[2] = 0.25
    found = bounded_least_squares(
        rng.normal(size=(ROWS, JOINTS)), rng.normal(size=ROWS), 1e-3, low, high
    )
    assert found[2] == 0.25
