"""WorldBatch: many simulations that step together, on all cores."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import ArrayLike, NDArray

from pianomime.keyboard import KEYS
from pianomime.world.key_sensor import NOTHING, sense, silenced
from pianomime.world.layout import LAYOUT
from pianomime.world.model import world_model
from pianomime.world.parameters import PHYSICS_DT, SUBSTEPS
from pianomime.world.state import (
    BLOW_UP,
    RESETS,
    STATE,
    PhysicsWarning,
    WorldState,
    controls_of_frame,
    finite,
    pressed,
    reset_pose_after_instability,
    starting_positions,
)
from pianomime.world_names import PAPER

_RECORDED = ("qpos", "qvel")
_NUMBER = 1  # Batch.warning holds (last info, number of warnings) of each kind.


class WorldBatch(WorldState):
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
        self.model = world_model(model)
        self.quiet = quiet
        # Which bodies sleep is not part of MuJoCo's state, so each world keeps its own data.
        self._batch = Batch(self.model, worlds, threads, persistent=True)
        self.blow_ups = np.zeros(worlds, np.int64)
        self.sounding = np.zeros((worlds, KEYS), bool)
        self.pedal = np.zeros(worlds, bool)
        self.key_events = NOTHING
        self.reset()

    def __len__(self) -> int:
        """Number of worlds."""
        return len(self.pedal)

    def reset(self, qpos: ArrayLike | None = None, ids: ArrayLike | None = None) -> None:
        """Set positions, with all velocities 0 and the pedals up.

        Args:
            qpos: (142,) or (54,) for all worlds, or (n, 142) or (n, 54) with a row for each, as
                in `World.reset`; None for the rest pose.
            ids: (n,) rising indices of the worlds; None for all.

        Raises:
            ValueError: `qpos` has another shape or is not finite, or `ids` are no rising indices;
                nothing is changed then.
        """
        which = self._which(ids)
        start = np.broadcast_to(starting_positions(qpos), (len(which), LAYOUT.qpos_size))
        self.blow_ups[which] = 0
        self.pedal[which] = False
        self._put(start, which)
        self._listen(which)

    def step(self, ctrl: ArrayLike, pedal: ArrayLike = False, ids: ArrayLike | None = None) -> None:
        """Simulate one frame of 0.05 s with constant controls, or with several, each as long.

        Args:
            ctrl: (n, 46) targets of the position actuators, or (n, S, 46), as in `World.step`
                [rad, m].
            pedal: (n,) bool, or one for all.
            ids: (n,) rising indices of the worlds to step; None for all. The others stay as they
                are, and have no key events.

        Raises:
            ValueError: `ctrl` has another shape or is not finite, or `ids` are no rising indices;
                nothing is changed then.
        """
        which = self._which(ids)
        targets = controls_of_frame(ctrl, 1, len(which), self.model.nu)
        self.pedal[which] = pedal
        self._keep_pressed_keys_awake(which)
        self.key_events, hold = NOTHING, SUBSTEPS // len(targets)
        for number, target in enumerate(targets):
            self._hold(target, hold, number * hold, which)

    def _hold(
        self, target: NDArray[np.float64], substeps: int, done: int, which: NDArray[np.int64]
    ) -> None:
        """Hold controls of some worlds for some physics steps, after others in the same step."""
        before = self._positions()[which]
        moved = np.empty((2, substeps + 1, len(which), KEYS))
        moved[:, 0] = before[:, :KEYS], self._velocities()[which, :KEYS]
        self._batch.bind("ctrl")[which] = target
        recorded = self._batch.rollout(substeps, record=_RECORDED, ids=which)
        for quantity, name in enumerate(_RECORDED):
            moved[quantity, 1:] = recorded[name][..., :KEYS].swapaxes(0, 1)
        broken = self._broken(which)
        sounding = self.sounding[which]
        lost = np.zeros_like(sounding)
        lost[broken], sounding[broken] = sounding[broken], False
        moved[:, 1:, broken] = moved[:, :1, broken]
        events = sense(moved[0], moved[1], sounding)
        self.sounding[which] = sounding
        if len(broken):
            self.blow_ups[which[broken]] += 1
            if not self.quiet:
                worlds = ", ".join(map(str, which[broken]))
                warnings.warn(f"{BLOW_UP} (worlds {worlds})", PhysicsWarning, stacklevel=3)
            recovered = reset_pose_after_instability(before[broken], self.model)
            self._put(recovered, which[broken])
            events = events.followed_by(silenced(lost, substeps * PHYSICS_DT))
        events = events._replace(world=which[events.world])
        self.key_events = self.key_events.followed_by(events.later(done * PHYSICS_DT))

    def state(self) -> NDArray[np.float64]:
        """(B, S) The state of each world, as `World.state` returns it."""
        state: NDArray[np.float64] = self._batch.state.copy()
        return state

    def set_state(self, state: ArrayLike, ids: ArrayLike | None = None) -> None:
        """Restore states, as `World.set_state` does.

        Args:
            state: (S,) for all worlds, or (n, S) with a row for each.
            ids: (n,) rising indices of the worlds; None for all.

        Raises:
            ValueError: `state` has another shape or is not finite, or `ids` are no rising indices;
                nothing is changed then.
        """
        which = self._which(ids)
        rows = (len(which), mujoco.mj_stateSize(self.model, STATE))
        given = finite(np.broadcast_to(np.asarray(state, float), rows), "state", rows)
        self.blow_ups[which] = 0
        self.pedal[which] = False
        self._batch.reset(which, stage=mujoco.mjtStage.mjSTAGE_NONE)
        self._batch.state[which] = given
        self._listen(which)

    def _listen(self, which: NDArray[np.int64]) -> None:
        """Let the keys of some worlds that are pressed sound, without an event."""
        self.sounding[which] = pressed(self._positions()[which])
        self.key_events = self.key_events.without(which)

    def _which(self, ids: ArrayLike | None) -> NDArray[np.int64]:
        if ids is None:
            return np.arange(len(self))
        given = np.asarray(ids)
        if not given.size and given.ndim == 1:
            return np.zeros(0, np.int64)
        # A mask would name worlds 0 and 1; what does not rise MuJoCo refuses, but in the middle.
        if given.ndim != 1 or given.dtype.kind not in "iu":
            raise ValueError(f"ids must be indices of worlds, not {given.dtype} {given.shape}")
        which = given.astype(np.int64)
        if which[0] < 0 or which[-1] >= len(self) or (np.diff(which) <= 0).any():
            raise ValueError(
                f"ids must rise from 0 or more to at most {len(self) - 1}, each once, not {which}"
            )
        return which

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

    def _broken(self, which: NDArray[np.int64]) -> NDArray[np.int64]:
        """Which of some worlds broke in their last physics steps, counted among them."""
        reset = self._batch.warning[which][:, RESETS, _NUMBER].any(axis=1)
        return np.flatnonzero(reset | ~np.isfinite(self._positions()[which]).all(axis=1))
