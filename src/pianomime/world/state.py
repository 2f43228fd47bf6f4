"""State readout and reset rules shared by World and WorldBatch."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import EllipsisType

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.keyboard import KEYS
from pianomime.world.key_sensor import PRESSED_WITHIN, KeyEvents
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES, name_of
from pianomime.world.overlap import overlap
from pianomime.world.parameters import SUBSTEPS, key_travel
from pianomime.world_names import SOLID

_DOWN = 0.002
"""[rad] A key turned by more than this must not fall asleep."""
_AWAKE = 2e-3
"""[rad/s] Upward velocity above MuJoCo's sleep threshold. A key under a finger loses it at once; a
free key is many times as fast within one physics step."""

STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""Components of MuJoCo's state that `World.state` holds."""
RESETS = [
    int(mujoco.mjtWarning.mjWARN_BADQPOS),
    int(mujoco.mjtWarning.mjWARN_BADQVEL),
    int(mujoco.mjtWarning.mjWARN_BADQACC),
]
"""MuJoCo's warnings that come with an automatic reset, that is, of unstable physics."""
_ALONG = [joints.start + LAYOUT.slide for joints in LAYOUT.joints]
"""Positions of both forearms along the keyboard, left and right."""
_OUTWARD = np.array([-1.0, 1.0])
"""Where left and right are on the outside."""
_PARTING = 5e-4
"""[m] Steps in which each hand is moved away from the other, to recover."""
_AT_ONCE = 64
"""Poses that are looked at together: one by one takes ten times as long."""
BLOW_UP = "the physics broke: hands opened above the keys where they were, keys up"
"""Message of `PhysicsWarning`."""


class PhysicsWarning(RuntimeWarning):
    """The simulation became unstable and was put into its recovery pose."""


class WorldState(ABC):
    """State readout of one world, or of B worlds, whose shapes then begin with B.

    Attributes:
        sounding: (..., 88) bool: keys that sound, as they sense it; no part of MuJoCo's state.
        key_events: what keys did in the last step.
    """

    sounding: NDArray[np.bool_]
    key_events: KeyEvents

    @property
    def qpos(self) -> NDArray[np.float64]:
        """(..., 142) Positions: 88 keys, right hand 27, left hand 27 [rad, m]; a copy."""
        return self._positions().copy()

    @property
    def qpos_hands(self) -> NDArray[np.float64]:
        """(..., 54) Positions of the hands, right 27 then left 27 [rad, m]; a copy."""
        return self._positions()[..., KEYS:].copy()

    @property
    def qvel_hands(self) -> NDArray[np.float64]:
        """(..., 54) Velocities of the hands, right 27 then left 27 [rad/s, m/s]; a copy."""
        return self._velocities()[..., KEYS:].copy()

    @property
    def key_state(self) -> NDArray[np.float64]:
        """(..., 88) How far each key is down: 0 at rest, 1 at its stop."""
        return key_state(self._positions())

    @property
    def pressed(self) -> NDArray[np.bool_]:
        """(..., 88) bool: keys that sound, within 0.5 degrees of their stop."""
        return pressed(self._positions())

    def _keep_pressed_keys_awake(self, which: EllipsisType | NDArray[np.int64] = ...) -> None:
        """Keep pressed keys awake.

        MuJoCo puts a body that does not move to sleep. A key held down would fall asleep, and stay
        down after its release.

        Args:
            which: (n,) indices of worlds; `...` for all, or for the only one.
        """
        keys = which, slice(KEYS)
        down = self._positions()[keys] > _DOWN
        velocity = self._velocities()[keys]
        velocity[down & (np.abs(velocity) < _AWAKE)] = -_AWAKE
        self._velocities()[keys] = velocity

    @abstractmethod
    def _positions(self) -> NDArray[np.float64]:
        """(..., 142) Positions [rad, m]; a view of the simulation."""

    @abstractmethod
    def _velocities(self) -> NDArray[np.float64]:
        """(..., 142) Velocities [rad/s, m/s]; a view of the simulation."""


def key_state(qpos: NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 88) How far each key is down, 0..1, from positions (..., 142)."""
    down: NDArray[np.float64] = np.clip(qpos[..., :KEYS] / key_travel(), 0.0, 1.0)
    return down


def pressed(qpos: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(..., 88) bool: keys that sound, from positions (..., 142)."""
    travel = key_travel()
    short = travel - np.clip(qpos[..., :KEYS], 0.0, travel)
    sounds: NDArray[np.bool_] = short <= PRESSED_WITHIN
    return sounds


def starting_positions(qpos: ArrayLike | None) -> NDArray[np.float64]:
    """(..., 142) Positions of keys and hands.

    Args:
        qpos: (..., 142), or (..., 54) of the hands with all keys up, or None for the rest pose.

    Raises:
        ValueError: `qpos` has another shape or is not finite.
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


def reset_pose_after_instability(
    qpos: NDArray[np.float64], model: mujoco.MjModel
) -> NDArray[np.float64]:
    """(..., 142) Recovery pose: as at rest, but with the forearms along the keyboard as they are.

    Hands that were fists, or one above the other, may have no room to be opened. In the solid
    world they then move apart along the keyboard, both as far, the shortest way.

    Args:
        qpos: (..., 142) positions before the step in which the physics became unstable.
        model: of the world.
    """
    opened = np.zeros_like(qpos)
    opened[..., _ALONG] = qpos[..., _ALONG]
    if name_of(model) == SOLID:
        for pose in opened.reshape(-1, LAYOUT.qpos_size):
            if _hands_touch(pose, model):
                _part(pose, model)
    return opened


def _hands_touch(qpos: NDArray[np.float64], model: mujoco.MjModel) -> bool:
    """Whether the hands touch in a pose (142,); they never do where one is out of the way."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    sides = [model.body(body).name.partition("_")[0] for body in range(model.nbody)]
    touching = {
        frozenset(sides[body] for body in model.geom_bodyid[pair]) for pair in data.contact.geom
    }
    return frozenset(SIDES) in touching


def _part(qpos: NDArray[np.float64], model: mujoco.MjModel) -> None:
    """Move the hands of a pose (142,) apart until they do not overlap; in place."""
    low, high = model.jnt_range[_ALONG].T
    steps = np.arange(1, round((high - low).max() / _PARTING))
    # Past each other, where that is nearer.
    moves = _PARTING * np.stack([steps, -steps], axis=1).reshape(-1, 1) * _OUTWARD
    tried = np.clip(qpos[_ALONG] + moves, low, high)
    for some in np.split(tried, range(_AT_ONCE, len(tried), _AT_ONCE)):
        poses = np.tile(qpos, (len(some), 1))
        poses[:, _ALONG] = some
        free = np.flatnonzero(overlap(poses[:, KEYS:]).hands == 0.0)
        if len(free):
            qpos[:] = poses[free[0]]
            return


def controls_of_frame(ctrl: ArrayLike, parts: int, *shape: int) -> NDArray[np.float64]:
    """(S, ..., 46) The controls of a part of a frame, of which there may be one or several.

    Args:
        ctrl: (..., 46), or (..., S, 46).
        parts: of how many parts of the frame it is one.
        shape: (..., 46), without S.

    Raises:
        ValueError: `ctrl` has another shape or is not finite, or the physics steps of a frame
            cannot be divided among so many controls.
    """
    given = np.asarray(ctrl, float)
    if given.ndim != len(shape) + 1:
        targets = finite(given, "ctrl", shape)[None]
    else:
        several = finite(given, "ctrl", (*shape[:-1], given.shape[-2], shape[-1]))
        targets = np.moveaxis(several, -2, 0)
    controls = len(targets) * parts
    if controls < 1 or SUBSTEPS % controls:
        raise ValueError(f"a frame of {SUBSTEPS} physics steps cannot have {controls} controls")
    return targets


def finite(values: ArrayLike, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """The values as an array.

    Args:
        values: what a caller gave.
        name: of the argument, for the message.
        shape: that it must have.

    Raises:
        ValueError: `values` have another shape or are not finite.
    """
    array = np.asarray(values, float)
    if array.shape != shape:
        raise ValueError(f"{name} must be {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds values that are not finite")
    return array
