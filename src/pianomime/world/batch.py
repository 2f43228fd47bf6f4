"""WorldBatch: many simulations that step together, on all cores."""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.world.batch_base import Held, WorldBatchBase
from pianomime.world.key_sensor import sense
from pianomime.world.state import RESETS
from pianomime.world_names import PAPER

_RECORDED = ("qpos", "qvel")
_NUMBER = 1  # Batch.warning holds (last info, number of warnings) of each kind.


class WorldBatch(WorldBatchBase):
    """B worlds that step together; each behaves as one `World` does, bit for bit.

    Where some of them are named, their indices `ids` rise: each stands once, and none is a mask.

    Attributes:
        model: the MuJoCo model, shared by all worlds; read-only.
        pedal: (B,) bool, whether each sustain pedal is down.
        sounding: (B, 88) bool: keys that sound, as they sense it (see `world.key_sensor`).
        key_events: note-ons and note-offs of the last step, timed between physics steps; those of
            a world that was reset or restored since are gone, as in a `World`.
        blow_ups: (B,) int, number of control steps since each world's last reset in which its
            physics became unstable; it is then recovered as a `World` is.
    """

    def __init__(
        self,
        worlds: int,
        threads: int = 0,
        quiet: bool = False,
        model: str | mujoco.MjModel = PAPER,
    ) -> None:
        """Make worlds at rest.

        Args:
            worlds: number of worlds, B.
            threads: number of threads that step them; 0 for one per core.
            quiet: do not warn when the physics becomes unstable.
            model: name of the world, or its model, as of `world_model`.

        Raises:
            InputError: there is no such world.
            ValueError: there are no worlds, or a negative number of threads.
        """
        if worlds < 1 or threads < 0:
            raise ValueError(f"cannot make {worlds} worlds on {threads} threads")
        super().__init__(worlds, quiet, model)
        # Which bodies sleep is not part of MuJoCo's state, so each world keeps its own data.
        self._batch = Batch(self.model, worlds, threads, persistent=True)
        self.reset()

    def state(self) -> NDArray[np.float64]:
        """(B, S) The state of each world, as `World.state` returns it."""
        state: NDArray[np.float64] = self._batch.state.copy()
        return state

    def _begin_frame(self, which: NDArray[np.int64]) -> None:
        self._keep_pressed_keys_awake(which)

    def _hold(self, target: NDArray[np.float64], substeps: int, which: NDArray[np.int64]) -> Held:
        before = self._positions()[which]
        moved = np.empty((2, substeps + 1, len(which), KEYS))
        moved[:, 0] = before[:, :KEYS], self._velocities()[which, :KEYS]
        self._batch.bind("ctrl")[which] = target
        recorded = self._batch.rollout(substeps, record=_RECORDED, ids=which)
        for quantity, name in enumerate(_RECORDED):
            moved[quantity, 1:] = recorded[name][..., :KEYS].swapaxes(0, 1)
        broken = self._broken(which)
        sounding = self.sounding[which]
        sounding[broken] = False
        moved[:, 1:, broken] = moved[:, :1, broken]
        # Of a broken world nothing is sensed: its keys are as if they had stayed where they were.
        events = sense(moved[0], moved[1], sounding)
        return Held(events, sounding, broken, before[broken])

    def _put(self, qpos: NDArray[np.float64], which: NDArray[np.int64]) -> None:
        self._batch.reset(which, stage=mujoco.mjtStage.mjSTAGE_NONE)
        self._batch.bind("qpos")[which] = qpos
        self._batch.forward(which)

    def _restore(self, state: NDArray[np.float64], which: NDArray[np.int64]) -> None:
        self._batch.reset(which, stage=mujoco.mjtStage.mjSTAGE_NONE)
        self._batch.state[which] = state

    def _positions(self) -> NDArray[np.float64]:
        positions: NDArray[np.float64] = self._batch.bind("qpos")
        return positions

    def _velocities(self) -> NDArray[np.float64]:
        velocities: NDArray[np.float64] = self._batch.bind("qvel")
        return velocities

    def _broken(self, which: NDArray[np.int64]) -> NDArray[np.int64]:
        """Which of some worlds broke in their last physics steps, counted among them."""
        reset = self._batch.warning[which][:, RESETS, _NUMBER].any(axis=1)
        return np.flatnonzero(reset | ~np.isfinite(self._positions()[which]).all(axis=1))
