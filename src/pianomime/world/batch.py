"""WorldBatch: many worlds at once, on all cores."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike, NDArray

from pianomime.world.layout import LAYOUT
from pianomime.world.model import world_model
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

_NUMBER = 1  # Batch.warning holds (last info, number) of each kind.


class WorldBatch(WorldState):
    """B worlds that step together; each is what one `World` would be, bit for bit.

    Attributes:
        model: the MuJoCo model, shared by all worlds; read-only.
        pedal: (B,) bool, whether each sustain pedal is down.
        blow_ups: (B,) int, control steps since each world's last reset in which its physics
            broke; it is then put back as `World` tells.
    """

    def __init__(self, worlds: int, threads: int = 0, quiet: bool = False) -> None:
        """Make worlds, at rest.

        Args:
            worlds: how many, B.
            threads: how many of them step at the same time; 0 for one on each core.
            quiet: whether broken physics goes without a warning.
        """
        if worlds < 1 or threads < 0:
            raise ValueError(f"cannot make {worlds} worlds on {threads} threads")
        self.model = world_model()
        self.quiet = quiet
        # Which keys sleep is not part of MuJoCo's state: each world keeps its own data.
        self._batch = Batch(self.model, worlds, threads, persistent=True)
        self.blow_ups = np.zeros(worlds, np.int64)
        self.pedal = np.zeros(worlds, bool)
        self.reset()

    def __len__(self) -> int:
        """Number of worlds."""
        return len(self.pedal)

    def reset(self, qpos: ArrayLike | None = None, ids: ArrayLike | None = None) -> None:
        """Put worlds at rest.

        Args:
            qpos: (142,) or (54,) for all alike, or (n, 142) or (n, 54) with a row for each of
                them, as in `World.reset`.
            ids: (n,) which worlds; None for all.

        Raises:
            ValueError: if `qpos` has another shape or is not finite.
        """
        which = self._which(ids)
        start = np.broadcast_to(starting_positions(qpos), (len(which), LAYOUT.qpos_size))
        self.blow_ups[which] = 0
        self.pedal[which] = False
        self._put(start, which)

    def step(self, ctrl: ArrayLike, pedal: ArrayLike = False) -> None:
        """Hold controls for one control step of 0.05 s.

        Args:
            ctrl: (B, 46) targets of the position actuators, as in `World.step`.
            pedal: (B,) bool, or one for all.

        Raises:
            ValueError: if `ctrl` has another shape or is not finite.
        """
        wanted = finite(ctrl, "ctrl", (len(self), self.model.nu))
        before = self.qpos
        self._batch.bind("ctrl")[:] = wanted
        self.pedal[:] = pedal
        self._keep_pressed_keys_awake()
        self._batch.step(nstep=SUBSTEPS)
        broken = self._broken()
        if len(broken):
            self.blow_ups[broken] += 1
            if not self.quiet:
                which = ", ".join(map(str, broken))
                warnings.warn(f"{BLOW_UP} (worlds {which})", PhysicsWarning, stacklevel=2)
            self._put(reset_pose_after_instability(before[broken]), broken)

    def state(self) -> NDArray[np.float64]:
        """(B, S) the moment of each world, as `World.state`."""
        state: NDArray[np.float64] = self._batch.state.copy()
        return state

    def set_state(self, state: ArrayLike, ids: ArrayLike | None = None) -> None:
        """Go to moments that `state` gave, as `World.set_state` does.

        Args:
            state: (S,) for all alike, or (n, S).
            ids: (n,) which worlds; None for all.

        Raises:
            ValueError: if `state` has another shape or is not finite.
        """
        which = self._which(ids)
        rows = (len(which), mujoco.mj_stateSize(self.model, STATE))
        given = finite(np.broadcast_to(np.asarray(state, float), rows), "state", rows)
        self.blow_ups[which] = 0
        self.pedal[which] = False
        self._batch.reset(which, stage=mujoco.mjtStage.mjSTAGE_NONE)
        self._batch.state[which] = given

    def _which(self, ids: ArrayLike | None) -> NDArray[np.int64]:
        return np.arange(len(self)) if ids is None else np.asarray(ids, np.int64)

    def _positions(self) -> NDArray[np.float64]:
        positions: NDArray[np.float64] = self._batch.bind("qpos")
        return positions

    def _velocities(self) -> NDArray[np.float64]:
        velocities: NDArray[np.float64] = self._batch.bind("qvel")
        return velocities

    def _put(self, qpos: NDArray[np.float64], which: NDArray[np.int64]) -> None:
        self._batch.reset(which, stage=mujoco.mjtStage.mjSTAGE_NONE)
        self._batch.bind("qpos")[which] = qpos
        self._batch.forward(which)

    def _broken(self) -> NDArray[np.int64]:
        reset = self._batch.warning[:, RESETS, _NUMBER].any(axis=1)
        return np.flatnonzero(reset | ~np.isfinite(self._positions()).all(axis=1))
