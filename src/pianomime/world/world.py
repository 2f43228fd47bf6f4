"""World: the simulated piano and hands, one 0.05 s control step at a time."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.world.figures import (
    FIGURES,
    HAND_JOINTS,
    KEYS,
    LEFT_JOINTS,
    RIGHT_JOINTS,
    SUBSTEPS,
    key_travel,
)
from pianomime.world.model import fingertip_sites, world_model

_RESETS = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)
PRESSED_WITHIN: float = FIGURES["keyboard"]["pressed_within"]
"""[rad] A key counts as pressed this close to its stop."""


class PhysicsWarning(RuntimeWarning):
    """The simulation broke and was put back."""


class World:
    """Piano, two hands and the pedal. Deterministic: same controls, same states, bit for bit.

    Attributes:
        model: the MuJoCo model, shared by all worlds; read-only.
        data: the MuJoCo state.
        pedal: whether the sustain pedal is down.
        blow_ups: control steps since the last reset in which the physics broke. The forearms
            are then put back along the keyboard to where they were before the step, with the
            hands open in their rest pose above the keys and all keys up: fingers that were
            wedged would break the physics again at once if they were left where they were.
    """

    def __init__(self) -> None:
        self.model = world_model()
        self.data = mujoco.MjData(self.model)
        self._tips = np.array(
            [[self.model.site(name).id for name in fingertip_sites(side)] for side in ("lh", "rh")]
        )
        self.reset()

    def reset(self, qpos: ArrayLike | None = None) -> None:
        """Put everything at rest.

        Args:
            qpos: (142,) positions of keys and hands, or (54,) of the hands (right, left) with
                all keys up; None for the rest pose, all joints 0 [rad, m].

        Raises:
            ValueError: if `qpos` has another shape or is not finite.
        """
        start = np.zeros(self.model.nq)
        if qpos is not None:
            given = np.asarray(qpos, float)
            if given.shape not in ((self.model.nq,), (2 * HAND_JOINTS,)):
                raise ValueError(f"qpos must be (142,) or (54,), not {given.shape}")
            if not np.isfinite(given).all():
                raise ValueError("qpos holds values that are not finite")
            start[-given.size :] = given
        self.blow_ups = 0
        self.pedal = False
        self._put(start)

    def step(self, ctrl: ArrayLike, pedal: bool = False) -> None:
        """Hold a control for one control step of 0.05 s.

        Args:
            ctrl: (46,) targets of the position actuators, right 23 then left 23 [rad, m];
                MuJoCo clamps them to their ranges.
            pedal: whether the sustain pedal is down.

        Raises:
            ValueError: if `ctrl` has another shape or is not finite.
        """
        wanted = np.asarray(ctrl, float)
        if wanted.shape != (self.model.nu,):
            raise ValueError(f"ctrl must be ({self.model.nu},), not {wanted.shape}")
        if not np.isfinite(wanted).all():
            raise ValueError("ctrl holds values that are not finite")
        before = self.data.qpos.copy()
        self.data.ctrl[:] = wanted
        self.pedal = bool(pedal)
        mujoco.mj_step(self.model, self.data, nstep=SUBSTEPS)
        if self._broken():
            self.blow_ups += 1
            warnings.warn(
                "the physics broke: hands opened above the keys where they were, keys up",
                PhysicsWarning,
                stacklevel=2,
            )
            self._put(_clear_of_keys(before))

    @property
    def qpos(self) -> NDArray[np.float64]:
        """(142,) positions: 88 keys, right hand 27, left hand 27 [rad, m]; a copy."""
        return self.data.qpos.copy()

    @property
    def qpos_hands(self) -> NDArray[np.float64]:
        """(54,) positions of the hands, right 27 then left 27 [rad, m]; a copy."""
        return self.data.qpos[KEYS:].copy()

    @property
    def qvel_hands(self) -> NDArray[np.float64]:
        """(54,) velocities of the hands, right 27 then left 27 [rad/s, m/s]; a copy."""
        return self.data.qvel[KEYS:].copy()

    @property
    def key_state(self) -> NDArray[np.float64]:
        """(88,) how far each key is down, 0..1."""
        return key_state(self.data.qpos)

    @property
    def pressed(self) -> NDArray[np.bool_]:
        """(88,) the keys that sound: within 0.5 degrees of their stop."""
        return pressed(self.data.qpos)

    @property
    def fingertips(self) -> NDArray[np.float64]:
        """(2, 6, 3) [m] hands (left, right); wrist, then thumb to little fingertip."""
        mujoco.mj_kinematics(self.model, self.data)
        tips: NDArray[np.float64] = self.data.site_xpos[self._tips]
        return tips

    def _put(self, qpos: NDArray[np.float64]) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = qpos
        mujoco.mj_forward(self.model, self.data)

    def _broken(self) -> bool:
        return bool(
            any(self.data.warning[int(kind)].number for kind in _RESETS)
            or not np.isfinite(self.data.qpos).all()
        )


def _clear_of_keys(qpos: NDArray[np.float64]) -> NDArray[np.float64]:
    opened = np.zeros_like(qpos)
    along = [RIGHT_JOINTS.start, LEFT_JOINTS.start]
    opened[along] = qpos[along]
    return opened


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
