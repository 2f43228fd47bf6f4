"""WarpBatch: many simulations that step together on a GPU, by MuJoCo Warp.

Imported only where it is asked for: it needs the extra "gpu". `docs/concepts/gpu.md` says in what
its physics differs from that of a `World`.
"""

from __future__ import annotations

import ctypes
import sys
from typing import Any

import mujoco
import mujoco_warp
import numpy as np
import warp
from numpy.typing import NDArray

from pianomime.device_names import CUDA, DeviceName
from pianomime.errors import InputError
from pianomime.keyboard import KEYS
from pianomime.world import warp_kernels
from pianomime.world.batch_base import Held, WorldBatchBase
from pianomime.world.key_sensor import KeyEvents, silent_at, sounds_at
from pianomime.world.parameters import SUBSTEPS, key_levers
from pianomime.world.state import STATE
from pianomime.world.warp_physics import sparse_for_warp
from pianomime.world_names import PAPER

_CONSTRAINTS = 384
"""Rows of constraints that a world has room for: nearly twice the most that random controls gave
in the solid world, 208 (`benchmarks/memory_gpu.py` prints how many are used)."""
_CONTACTS = 128
"""Pairs of geometries near each other, and contacts, that there is room for in a world, on average
of all worlds: five times the most that random controls gave in the solid world, 24."""
_LOST = int(
    mujoco_warp.OverflowType.NEFC
    | mujoco_warp.OverflowType.NJMAX_NNZ
    | mujoco_warp.OverflowType.BROADPHASE
    | mujoco_warp.OverflowType.NARROWPHASE
    | mujoco_warp.OverflowType.CCD
)
"""What Warp reports of a world some of whose contacts it may have had no room for."""
_NO_GPU = "the device cuda needs a GPU of NVIDIA with its driver; there is none"


class WarpBatch(WorldBatchBase):
    """B worlds that step together on a GPU; each behaves nearly as one `World` does.

    It is used as a `WorldBatch` is. Numbers have single precision, the physics is that of
    `warp_physics`, and the state stays on the GPU until it is asked for. To step some of the worlds
    takes longer than to step all.

    A world that has more rows of constraints than it has room for counts as one whose physics
    broke. Room for contacts they share; where all together have more, all count as broken.

    Attributes:
        device: the name of the device.
    """

    def __init__(
        self,
        worlds: int,
        device: DeviceName = CUDA,
        quiet: bool = False,
        model: str | mujoco.MjModel = PAPER,
    ) -> None:
        """Make worlds at rest. The first of a machine compiles kernels, for a minute or two.

        Args:
            worlds: number of worlds, B.
            device: "cuda" or "warp-cpu".
            quiet: do not warn when the physics becomes unstable.
            model: name of the world, or its model, as of `world_model`.

        Raises:
            InputError: there is no such world, or no GPU that Warp can use.
            ValueError: there are no worlds.
        """
        if worlds < 1:
            raise ValueError(f"cannot make {worlds} worlds")
        super().__init__(worlds, quiet, model)
        self.device = device
        self._on = warp_device(device)
        self._seen: dict[str, NDArray[np.float64]] = {}
        self._graphs: dict[int, Any] = {}
        with warp.ScopedDevice(self._on):
            self._make(worlds)
            # Kernels are compiled and loaded here, since none can be while a graph is captured.
            self._launch(1)
        self.reset()

    def _make(self, worlds: int) -> None:
        simulated = sparse_for_warp(self.model)
        self._model = mujoco_warp.put_model(simulated)
        # An overflow is seen in `find_broken`; thousands of worlds would print thousands of lines.
        self._model.opt.warn_overflow = 0
        data = mujoco_warp.make_data(
            simulated, nworld=worlds, nconmax=_CONTACTS, njmax=_CONSTRAINTS
        )
        self._data = data
        # The components of MuJoCo's state that this model has, in the order of their bits in it.
        # Forces are vectors of six numbers each; here all are rows of numbers.
        forces = data.xfrc_applied
        components = {
            mujoco.mjtState.mjSTATE_TIME: data.time.reshape((worlds, 1)),
            mujoco.mjtState.mjSTATE_QPOS: data.qpos,
            mujoco.mjtState.mjSTATE_QVEL: data.qvel,
            mujoco.mjtState.mjSTATE_WARMSTART: data.qacc_warmstart,
            mujoco.mjtState.mjSTATE_CTRL: data.ctrl,
            mujoco.mjtState.mjSTATE_QFRC_APPLIED: data.qfrc_applied,
            mujoco.mjtState.mjSTATE_XFRC_APPLIED: warp.array(
                ptr=forces.ptr, dtype=float, shape=(worlds, forces.size * 6 // worlds)
            ),
        }
        self._components = list(components.values())
        size = (worlds, self.model.nq)
        self._before = warp.zeros(size, dtype=float)
        self._angle = warp.zeros((worlds, KEYS), dtype=float)
        self._turning = warp.zeros((worlds, KEYS), dtype=float)
        self._sounding = warp.zeros((worlds, KEYS), dtype=int)
        self._broken = warp.zeros(worlds, dtype=int)
        self._count = warp.zeros(1, dtype=int)
        # Room for an event of each key in each physics step: more there cannot be.
        most = worlds * KEYS * SUBSTEPS
        self._event_key = warp.zeros((most, 3), dtype=int)
        self._event_moment = warp.zeros((most, 2), dtype=float)
        self._on_at = warp.array(sounds_at(), dtype=float)
        self._off_at = warp.array(silent_at(), dtype=float)

    def state(self) -> NDArray[np.float64]:
        """(B, S) The state of each world, as `World.state` returns it, in single precision."""
        return np.hstack([component.numpy() for component in self._components]).astype(float)

    def _hold(self, target: NDArray[np.float64], substeps: int, which: NDArray[np.int64]) -> Held:
        others = np.setdiff1d(np.arange(len(self)), which)
        kept = self.state()[others] if len(others) else None
        with warp.ScopedDevice(self._on):
            self._write(self._data.ctrl, target, 0, which)
            self._sounding.assign(self.sounding.astype(np.int32))
            self._simulate(substeps)
        self._seen.clear()
        if kept is not None:
            self._restore(kept, others)
        broken = np.flatnonzero(self._broken.numpy()[which])
        sounding = self._sounding.numpy()[which].astype(bool)
        sounding[broken] = False
        before = np.zeros((0, self.model.nq))
        if len(broken):
            before = self._before.numpy()[which[broken]].astype(float)
        return Held(self._events(which, broken), sounding, broken, before)

    def _simulate(self, substeps: int) -> None:
        """Simulate all worlds; on a GPU as a graph, whose kernels the processor starts at once."""
        if not self._on.is_cuda:
            self._launch(substeps)
            return
        if substeps not in self._graphs:
            with warp.ScopedCapture() as capture:
                self._launch(substeps)
            self._graphs[substeps] = capture.graph
        warp.capture_launch(self._graphs[substeps])

    def _launch(self, substeps: int) -> None:
        """Launch all kernels of some physics steps; nothing is copied to the processor."""
        data, size = self._data, self._before.shape
        keys = [self._before, self._angle, self._turning]
        warp.launch(
            warp_kernels.begin,
            dim=size,
            inputs=[data.qpos, data.qvel],
            outputs=[*keys, self._broken, data.overflow, self._count],
        )
        for substep in range(substeps):
            mujoco_warp.step(self._model, data)
            warp.launch(
                warp_kernels.find_broken,
                dim=size,
                inputs=[data.qpos, data.qvel, data.qacc, data.overflow, _LOST],
                outputs=[self._broken],
            )
            warp.launch(
                warp_kernels.sense_keys,
                dim=size,
                inputs=[substep, self._on_at, self._off_at, self._before, self._broken],
                outputs=[
                    *(data.qpos, data.qvel, data.qacc_warmstart),
                    *(self._angle, self._turning, self._sounding),
                    *(self._count, self._event_key, self._event_moment),
                ],
            )

    def _events(self, which: NDArray[np.int64], broken: NDArray[np.int64]) -> KeyEvents:
        """The events of some worlds but the broken ones, in the order that `sense` gives them."""
        count = int(self._count.numpy()[0])
        world, key, on = self._event_key[:count].numpy().astype(np.int64).T
        time, turning = self._event_moment[:count].numpy().astype(float).T
        # Threads add them in any order.
        order = np.lexsort((time, key, world))
        order = order[np.isin(world[order], np.delete(which, broken))]
        world, key, on, time, turning = (
            values[order] for values in (world, key, on, time, turning)
        )
        speed = turning * key_levers()[key]
        return KeyEvents(np.searchsorted(which, world), key, on.astype(bool), time, speed)

    def _put(self, qpos: NDArray[np.float64], which: NDArray[np.int64]) -> None:
        state = np.zeros((len(which), mujoco.mj_stateSize(self.model, STATE)))
        first = mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_TIME)
        state[:, first : first + self.model.nq] = qpos
        self._restore(state, which)

    def _restore(self, state: NDArray[np.float64], which: NDArray[np.int64]) -> None:
        self._seen.clear()
        first = 0
        with warp.ScopedDevice(self._on):
            for component in self._components:
                self._write(component, state, first, which)
                first += component.shape[1]

    def _write(
        self, out: Any, values: NDArray[np.float64], first: int, which: NDArray[np.int64]
    ) -> None:
        """Write columns of `values` (n, ...), from the first one on, into rows on the device."""
        if not len(which):
            return
        columns = values[:, first : first + out.shape[1]]
        warp.launch(
            warp_kernels.write_rows,
            dim=columns.shape,
            inputs=[warp.array(which, dtype=int), warp.array(columns, dtype=float)],
            outputs=[out],
        )

    def _positions(self) -> NDArray[np.float64]:
        return self._see("qpos", self._data.qpos)

    def _velocities(self) -> NDArray[np.float64]:
        return self._see("qvel", self._data.qvel)

    def _see(self, name: str, component: Any) -> NDArray[np.float64]:
        """A copy on the processor, made once after each change."""
        if name not in self._seen:
            self._seen[name] = component.numpy().astype(float)
        return self._seen[name]


def warp_device(device: DeviceName) -> Any:
    """Warp's device of a name.

    Args:
        device: "cuda" or "warp-cpu".

    Raises:
        InputError: there is no GPU that Warp can use.
    """
    if device == CUDA and not _has_driver():
        # Warp would print a line of its own before this one.
        raise InputError(_NO_GPU)
    level = warp.config.log_level
    # That there is no driver is said below.
    warp.config.log_level = warp.LOG_ERROR
    warp.init()
    # Warp would print a line for each of a hundred modules that it loads.
    warp.config.log_level = max(level, warp.LOG_WARNING)
    if device == CUDA and not warp.is_cuda_available():
        raise InputError(_NO_GPU)
    return warp.get_device("cuda:0" if device == CUDA else "cpu")


def _has_driver() -> bool:
    """Whether this machine has the driver's library, under one of the names that Warp asks for."""
    for name in ("nvcuda.dll",) if sys.platform == "win32" else ("libcuda.so", "libcuda.so.1"):
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False
