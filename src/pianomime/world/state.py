"""State readout and reset rules shared by World and WorldBatch."""

from __future__ import annotations

from abc import ABC, abstractmethod

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.keyboard import KEYS
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import PARAMETERS, key_travel

PRESSED_WITHIN: float = PARAMETERS["keyboard"]["pressed_within"]
"""[rad] A key counts as pressed this close to its stop."""

_DOWN = 0.002
"""[rad] A key turned by more than this is not at rest, whatever its velocity."""
_AWAKE = 2e-3
"""[rad/s] Upward velocity above MuJoCo's threshold of sleep. A key under a finger loses it at once,
and a free key is many times as fast within one step of the physics."""

STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""The parts of MuJoCo's state that a saved state holds."""
RESETS = [
    int(mujoco.mjtWarning.mjWARN_BADQPOS),
    int(mujoco.mjtWarning.mjWARN_BADQVEL),
    int(mujoco.mjtWarning.mjWARN_BADQACC),
]
"""MuJoCo's warnings that come with an automatic reset."""
BLOW_UP = "the physics broke: hands opened above the keys where they were, keys up"


class PhysicsWarning(RuntimeWarning):
    """The simulation broke and was put back."""


class WorldState(ABC):
    """What can be read from one world, or from B worlds: all shapes then begin with B."""

    @property
    def qpos(self) -> NDArray[np.float64]:
        """(..., 142) positions: 88 keys, right hand 27, left hand 27 [rad, m]; a copy."""
        return self._positions().copy()

    @property
    def qpos_hands(self) -> NDArray[np.float64]:
        """(..., 54) positions of the hands, right 27 then left 27 [rad, m]; a copy."""
        return self._positions()[..., KEYS:].copy()

    @property
    def qvel_hands(self) -> NDArray[np.float64]:
        """(..., 54) velocities of the hands, right 27 then left 27 [rad/s, m/s]; a copy."""
        return self._velocities()[..., KEYS:].copy()

    @property
    def key_state(self) -> NDArray[np.float64]:
        """(..., 88) how far each key is down, 0..1."""
        return key_state(self._positions())

    @property
    def pressed(self) -> NDArray[np.bool_]:
        """(..., 88) the keys that sound: within 0.5 degrees of their stop."""
        return pressed(self._positions())

    def _keep_pressed_keys_awake(self) -> None:
        """Keep pressed keys awake.

        MuJoCo puts a body that does not move to sleep. A key held down would fall asleep, and stay
        down after its release.
        """
        down = self._positions()[..., :KEYS] > _DOWN
        velocity = self._velocities()[..., :KEYS]
        velocity[down & (np.abs(velocity) < _AWAKE)] = -_AWAKE

    @abstractmethod
    def _positions(self) -> NDArray[np.float64]:
        """(..., 142) live."""

    @abstractmethod
    def _velocities(self) -> NDArray[np.float64]:
        """(..., 142) live."""


def key_state(qpos: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far keys are down, 0..1: (..., 88) from positions (..., 142)."""
    down: NDArray[np.float64] = np.clip(qpos[..., :KEYS] / key_travel(), 0.0, 1.0)
    return down


def pressed(qpos: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which keys sound: (..., 88) bool from positions (..., 142)."""
    travel = key_travel()
    short = travel - np.clip(qpos[..., :KEYS], 0.0, travel)
    sounds: NDArray[np.bool_] = short <= PRESSED_WITHIN
    return sounds


def starting_positions(qpos: ArrayLike | None) -> NDArray[np.float64]:
    """(..., 142) from positions of everything, of the hands (..., 54), or None for rest.

    Raises:
        ValueError: if `qpos` has another shape or is not finite.
    """
    if qpos is None:
        return np.zeros(LAYOUT.qpos_size)
    given = np.asarray(qpos, float)
    size = given.shape[-1] if given.ndim else 0
    if size not in (LAYOUT.qpos_size, LAYOUT.hands_size):
        raise ValueError(
            f"qpos must hold {LAYOUT.qpos_size} or {LAYOUT.hands_size} positions, not {given.shape}"
        )
    start = np.zeros((*given.shape[:-1], LAYOUT.qpos_size))
    start[..., -size:] = finite(given, "qpos", given.shape)
    return start


def reset_pose_after_instability(qpos: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where hands are put when the physics broke: positions (..., 142) from those before."""
    opened = np.zeros_like(qpos)
    along = [LAYOUT.joints[1].start, LAYOUT.joints[0].start]
    opened[..., along] = qpos[..., along]
    return opened


def finite(values: ArrayLike, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """The values as an array.

    Raises:
        ValueError: if they have another shape or are not finite.
    """
    array = np.asarray(values, float)
    if array.shape != shape:
        raise ValueError(f"{name} must be {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds values that are not finite")
    return array
