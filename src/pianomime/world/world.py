"""World: the simulated piano and hands, one 0.05 s control step at a time."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.world.model import fingertip_sites, world_model
from pianomime.world.parameters import SUBSTEPS
from pianomime.world.state import (
    BLOW_UP,
    RESETS,
    STATE,
    PhysicsWarning,
    WorldState,
    finite,
    reset_pose_after_instability,
    starting_positions,
)


class World(WorldState):
    """Piano, two hands and the pedal. Deterministic: same controls, same states, bit for bit.

    Attributes:
        model: the MuJoCo model, shared by all worlds; read-only.
        data: the MuJoCo state.
        pedal: whether the sustain pedal is down.
        blow_ups: control steps since the last reset in which the physics broke. The forearms
            are then put back along the keyboard to where they were before the step, with the
            hands open in their rest pose above the keys and all keys up: fingers that were
            wedged would break the physics again at once if they were left where they were.
        quiet: whether that goes without a warning, as in a world that is only imagined.
    """

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet
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
        start = starting_positions(qpos)
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
        wanted = finite(ctrl, "ctrl", (self.model.nu,))
        before = self.data.qpos.copy()
        self.data.ctrl[:] = wanted
        self.pedal = bool(pedal)
        self._keep_pressed_keys_awake()
        mujoco.mj_step(self.model, self.data, nstep=SUBSTEPS)
        if self._broken():
            self.blow_ups += 1
            if not self.quiet:
                warnings.warn(BLOW_UP, PhysicsWarning, stacklevel=2)
            self._put(reset_pose_after_instability(before))

    def state(self) -> NDArray[np.float64]:
        """(S,) the moment as numbers, for `set_state` of any World or WorldBatch.

        All that the physics goes on from, but for which keys sleep.
        """
        state = np.empty(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self.data, state, STATE)
        return state

    def set_state(self, state: ArrayLike) -> None:
        """Go to a moment that `state` gave; blow-ups are counted from here, the pedal is up.

        What follows is the same for every World and WorldBatch that goes there, bit for bit. It
        may differ a little from what followed for the World that the state was taken from: keys
        that slept there are awake here. `copy` does without that difference.

        Args:
            state: (S,).

        Raises:
            ValueError: if `state` has another shape or is not finite.
        """
        given = finite(state, "state", (mujoco.mj_stateSize(self.model, STATE),))
        self.blow_ups = 0
        self.pedal = False
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, given, STATE)

    def copy(self, quiet: bool = False) -> World:
        """Another world in the same moment: it goes on as this one does, bit for bit."""
        other = World(quiet)
        mujoco.mj_copyData(other.data, self.model, self.data)
        other.blow_ups, other.pedal = self.blow_ups, self.pedal
        return other

    @property
    def fingertips(self) -> NDArray[np.float64]:
        """(2, 6, 3) [m] hands (left, right); wrist, then thumb to little fingertip."""
        mujoco.mj_kinematics(self.model, self.data)
        tips: NDArray[np.float64] = self.data.site_xpos[self._tips]
        return tips

    def _positions(self) -> NDArray[np.float64]:
        positions: NDArray[np.float64] = self.data.qpos
        return positions

    def _velocities(self) -> NDArray[np.float64]:
        velocities: NDArray[np.float64] = self.data.qvel
        return velocities

    def _put(self, qpos: NDArray[np.float64]) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = qpos
        mujoco.mj_forward(self.model, self.data)

    def _broken(self) -> bool:
        return bool(
            any(self.data.warning[kind].number for kind in RESETS)
            or not np.isfinite(self.data.qpos).all()
        )
