"""The noise of DAgger: how large it is for each actuator, and how it goes on."""

from __future__ import annotations

import numpy as np
import pytest

from pianomime.keyboard import NO_KEY
from pianomime.learn.data.noisy_controller import NoisyController, noise_spread
from pianomime.plan import FingertipPlan
from pianomime.track import ReplayTracker
from pianomime.world import World
from pianomime.world.layout import LAYOUT

FRAMES = 4000


def test_arms_get_as_much_noise_as_moves_a_fingertip_as_far() -> None:
    """A wrist three tenths of what a finger gets, a forearm three hundredths [rad, m]."""
    size, correlation = 0.5, 0.7
    nobody = np.empty(0, np.int8)
    plan = FingertipPlan(
        np.zeros((FRAMES, 2, 6, 3)), np.full((FRAMES, 2, 5), NO_KEY, np.int8), nobody, nobody
    )
    expert = ReplayTracker(np.ones((FRAMES, LAYOUT.ctrl_size))).start(plan)
    noisy = NoisyController(expert, None, noise_spread(size), correlation, np.random.default_rng(0))
    world = World()
    noise = np.array([noisy.control(frame, world) for frame in range(FRAMES)]) - 1.0
    # What is recorded is what the expert does.
    assert (noisy.labels == 1.0).all()
    wanted = np.ones(LAYOUT.hand_actuators)
    wanted[LAYOUT.wrist_actuators] = 0.3
    wanted[LAYOUT.slide_actuators] = 0.03
    for part in LAYOUT.actuators:
        np.testing.assert_allclose(noise[:, part].std(axis=0), size * wanted, rtol=0.15)
    # Of actuators together, for one has few independent frames.
    alike = noise / noise.std(axis=0)
    assert (alike[1:] * alike[:-1]).mean() == pytest.approx(correlation, abs=0.02)
    assert (alike[2:] * alike[:-2]).mean() == pytest.approx(correlation**2, abs=0.03)
    assert not np.allclose(noise[:, LAYOUT.actuators[0]], noise[:, LAYOUT.actuators[1]])
