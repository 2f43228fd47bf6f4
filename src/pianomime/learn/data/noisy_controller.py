"""The controller of DAgger: it plays with noise, and keeps what the expert would do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.track import Controller
from pianomime.world import World
from pianomime.world.hand import by_actuator
from pianomime.world.layout import LAYOUT

_NOISE_SCALE = by_actuator(1.0, 0.3, 0.03)
"""(46,) [rad, m] noise of each actuator that moves fingertips about as far as 1 rad of a finger."""


def noise_spread(finger_noise: float) -> NDArray[np.float64]:
    """(46,) Noise of each actuator that moves fingertips about as far as that of a finger's.

    Args:
        finger_noise: standard deviation of the noise of fingers' actuators [rad].

    Returns:
        Standard deviations [rad, m].
    """
    return finger_noise * _NOISE_SCALE


class NoisyController:
    """Plays a policy, or the expert, with noise, and keeps what the expert would do.

    Attributes:
        replayable: False, for every call draws noise.
        plan: what the expert follows.
        labels: (T, 46) the expert's control in the state before each frame [rad, m].

    Args:
        expert: the expert, which must be replayable: it is asked in states that it did not choose.
        policy: plays instead of it, if given.
        spread: (46,) standard deviation of the noise [rad, m].
        correlation: of the noise from frame to frame: an autoregressive process of order 1.
        rng: of the noise.

    Raises:
        InputError: the expert plans nothing, or keeps a memory of what it did.
    """

    replayable = False

    def __init__(
        self,
        expert: Controller,
        policy: Controller | None,
        spread: NDArray[np.float64],
        correlation: float,
        rng: np.random.Generator,
    ) -> None:
        if expert.plan is None or not expert.replayable:
            raise InputError(
                "noise needs a player that can be asked what to do in any state, such as "
                "zero-shot-20hz at effort 0"
            )
        self.plan = expert.plan
        self.labels = np.empty((len(expert.plan), LAYOUT.ctrl_size))
        self._expert, self._policy = expert, policy
        self._spread, self._correlation, self._rng = spread, correlation, rng
        self._noise = np.zeros(LAYOUT.ctrl_size)

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """As `Controller.control`."""
        action = self.labels[frame] = self._expert.control(frame, world)
        played = action if self._policy is None else self._policy.control(frame, world)
        fresh = self._rng.standard_normal(LAYOUT.ctrl_size)
        self._noise = self._correlation * self._noise + np.sqrt(1.0 - self._correlation**2) * fresh
        ctrl: NDArray[np.float64] = played + self._spread * self._noise
        return ctrl
