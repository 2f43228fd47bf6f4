"""What every batch of worlds does alike, whatever steps its physics."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.keyboard import KEYS
from pianomime.world.key_sensor import NOTHING, KeyEvents, silenced
from pianomime.world.layout import LAYOUT
from pianomime.world.model import world_model
from pianomime.world.parameters import PHYSICS_DT, SUBSTEPS
from pianomime.world.state import (
    BLOW_UP,
    STATE,
    PhysicsWarning,
    WorldState,
    controls_of_frame,
    finite,
    pressed,
    reset_pose_after_instability,
    starting_positions,
)


class Held(NamedTuple):
    """What happened in n worlds while a control was held.

    Attributes:
        events: of the keys, with times from when the control began, and worlds counted among the
            n; none of broken worlds.
        sounding: (n, 88) bool: keys that sound at the end; none in broken worlds.
        broken: (m,) the worlds among the n in which the physics broke, rising.
        before: (m, 142) positions in which these were when the control began [rad, m].
    """

    events: KeyEvents
    sounding: NDArray[np.bool_]
    broken: NDArray[np.int64]
    before: NDArray[np.float64]


class OneOfBatch(WorldState):
    """What can be read of one world of a batch, as it is at that time.

    Attributes:
        sounding: (88,) bool: keys that sound, as they sense it; a view.

    Args:
        batch: the batch.
        index: of the world.
    """

    def __init__(self, batch: WorldBatchBase, index: int) -> None:
        self._batch, self._index = batch, index
        self.sounding = batch.sounding[index]

    @property
    def key_events(self) -> KeyEvents:  # type: ignore[override]  # read-only
        """What its keys did in the last step."""
        return self._batch.key_events.of(self._index)

    @property
    def blow_ups(self) -> int:
        """Control steps since its last reset in which its physics became unstable."""
        return int(self._batch.blow_ups[self._index])

    def _positions(self) -> NDArray[np.float64]:
        positions: NDArray[np.float64] = self._batch._positions()[self._index]
        return positions

    def _velocities(self) -> NDArray[np.float64]:
        velocities: NDArray[np.float64] = self._batch._velocities()[self._index]
        return velocities


class WorldBatchBase(WorldState):
    """B worlds that step together.

    Where some of them are named, their indices `ids` rise: each stands once, and none is a mask.

    Attributes:
        model: the MuJoCo model, shared by all worlds; read-only.
        quiet: whether unstable physics raises no `PhysicsWarning`.
        pedal: (B,) bool, whether each sustain pedal is down.
        sounding: (B, 88) bool: keys that sound, as they sense it (see `world.key_sensor`).
        key_events: note-ons and note-offs of the last step, timed between physics steps; those of
            a world that was reset or restored since are gone, as in a `World`.
        blow_ups: (B,) int, number of control steps since each world's last reset in which its
            physics became unstable; it is then recovered as a `World` is.
    """

    def __init__(self, worlds: int, quiet: bool, model: str | mujoco.MjModel) -> None:
        """Make what all batches have; a subclass then makes its physics, and calls `reset`.

        Args:
            worlds: number of worlds, B.
            quiet: do not warn when the physics becomes unstable.
            model: name of the world, or its model, as of `world_model`.

        Raises:
            InputError: there is no such world.
        """
        self.model = world_model(model)
        self.quiet = quiet
        self.blow_ups = np.zeros(worlds, np.int64)
        self.sounding = np.zeros((worlds, KEYS), bool)
        self.pedal = np.zeros(worlds, bool)
        self.key_events = NOTHING

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
        self._begin_frame(which)
        self.key_events, hold = NOTHING, SUBSTEPS // len(targets)
        for number, target in enumerate(targets):
            self._hold_and_recover(target, hold, number * hold, which)

    def _hold_and_recover(
        self, target: NDArray[np.float64], substeps: int, done: int, which: NDArray[np.int64]
    ) -> None:
        """Hold controls of some worlds for some physics steps, after others in the same step."""
        held = self._hold(target, substeps, which)
        events, broken = held.events, held.broken
        lost = self.sounding[which[broken]]
        self.sounding[which] = held.sounding
        if len(broken):
            self.blow_ups[which[broken]] += 1
            if not self.quiet:
                worlds = ", ".join(map(str, which[broken]))
                warnings.warn(f"{BLOW_UP} (worlds {worlds})", PhysicsWarning, stacklevel=3)
            self._put(reset_pose_after_instability(held.before, self.model), which[broken])
            silent = silenced(lost, substeps * PHYSICS_DT)
            events = events.followed_by(silent._replace(world=broken[silent.world]))
        events = events._replace(world=which[events.world])
        self.key_events = self.key_events.followed_by(events.later(done * PHYSICS_DT))

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
        self._restore(given, which)
        self._listen(which)

    @abstractmethod
    def state(self) -> NDArray[np.float64]:
        """(B, S) The state of each world, as `World.state` returns it."""

    def _begin_frame(self, which: NDArray[np.int64]) -> None:
        """Prepare some worlds for a frame."""

    @abstractmethod
    def _hold(self, target: NDArray[np.float64], substeps: int, which: NDArray[np.int64]) -> Held:
        """Hold controls (n, 46) of n worlds for some physics steps.

        Broken worlds may be left in any state: they are put into their recovery pose afterwards.
        """

    @abstractmethod
    def _put(self, qpos: NDArray[np.float64], which: NDArray[np.int64]) -> None:
        """Put some worlds at rest in positions (n, 142)."""

    @abstractmethod
    def _restore(self, state: NDArray[np.float64], which: NDArray[np.int64]) -> None:
        """Bring some worlds into states (n, S)."""

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
