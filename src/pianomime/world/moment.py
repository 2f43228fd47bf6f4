"""What one World and many of them have in common: what can be read off, and the rules."""

from __future__ import annotations

from abc import ABC, abstractmethod

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.world.figures import (
    FIGURES,
    HAND_JOINTS,
    KEYS,
    LEFT_JOINTS,
    RIGHT_JOINTS,
    key_travel,
)

POSITIONS = KEYS + 2 * HAND_JOINTS
PRESSED_WITHIN: float = FIGURES["keyboard"]["pressed_within"]
"""[rad] A key counts as pressed this close to its stop."""

_DOWN = 0.002
"""[rad] A key turned by more than this is not at rest, whatever its velocity."""
_STIR = 2e-3
"""[rad/s] Upward velocity that MuJoCo does not take for sleep; a key under a finger loses it at
once, and a free one has many times as much within one step of the physics."""

STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""The parts of MuJoCo's state that make up a moment."""
RESETS = [
    int(mujoco.mjtWarning.mjWARN_BADQPOS),
    int(mujoco.mjtWarning.mjWARN_BADQVEL),
    int(mujoco.mjtWarning.mjWARN_BADQACC),
]
"""MuJoCo's warnings that go with a reset it makes by itself."""
BLOW_UP = "the physics broke: hands opened above the keys where they were, keys up"


class PhysicsWarning(RuntimeWarning):
    """The simulation broke and was put back."""


class Moment(ABC):
    """What can be read off one world, or off many: then all shapes begin with their number."""

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

    def _stir_keys(self) -> None:
        """Keep keys awake that are down.

        MuJoCo lets sleep what does not move. A key that a finger holds down does not move, and
        slept on, down, when the finger was gone before the spring could move it.
        """
        down = self._positions()[..., :KEYS] > _DOWN
        velocity = self._velocities()[..., :KEYS]
        velocity[down & (np.abs(velocity) < _STIR)] = -_STIR

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
        return np.zeros(POSITIONS)
    given = np.asarray(qpos, float)
    size = given.shape[-1] if given.ndim else 0
    if size not in (POSITIONS, 2 * HAND_JOINTS):
        raise ValueError(f"qpos must hold 142 or 54 positions, not {given.shape}")
    start = np.zeros((*given.shape[:-1], POSITIONS))
    start[..., -size:] = finite(given, "qpos", given.shape)
    return start


def clear_of_keys(qpos: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where hands are put when the physics broke: positions (..., 142) from those before."""
    opened = np.zeros_like(qpos)
    along = [RIGHT_JOINTS.start, LEFT_JOINTS.start]
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
