"""Performances to be exported."""

from __future__ import annotations

import numpy as np
import pytest

import made_up
from pianomime.players.performance import Performance
from pianomime.world.model import world_model
from pianomime.world_names import WORLDS


@pytest.fixture(scope="session", params=WORLDS)
def performance(request: pytest.FixtureRequest) -> Performance:
    """Hands move all their joints for 0.6 s, by five controls a frame, some beyond their range."""
    draw = np.random.default_rng(5)
    low, high = world_model(request.param).actuator_ctrlrange.T
    share = np.cumsum(draw.normal(0, 0.1, (12, 5, len(low))), axis=1) + draw.uniform(
        -0.1, 1.1, len(low)
    )
    return made_up.performed(low + share * (high - low), request.param)
