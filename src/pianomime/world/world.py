"""World: one simulation of piano and hands, stepped by frames of 0.05 s or parts of frames."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.keyboard import KEYS
from pianomime.world.key_sensor import NOTHING, sense, silenced
from pianomime.world.model import SIDES, fingertip_sites, name_of, world_model
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


class World(WorldState):
    """Piano, two hands and the pedal. The same controls give the same states, bit for bit.

    Attributes:
        model: the MuJoCo model, shared by all worlds; read-only.
        data: the MuJoCo state.
        pedal: whether the sustain pedal is down.
        sounding: (88,) bool: keys that sound, as they sense it (see `world.key_sensor`).
        key_events: note-ons and note-offs of the last step, timed between physics steps.
        blow_ups: number of control steps since the last reset in which the physics became
            unstable. Such a step, or the part of it with one of several controls, ends in a
            recovery pose: forearms along the keyboard where they were before it, hands open above
            the keys, all keys up. (Wedged fingers left in place would become unstable again at
            once.) In the solid world hands that would overlap so are moved apart.
        quiet: whether unstable physics raises no `PhysicsWarning`.
    """

    def __init__(self, model: str | mujoco.MjModel = PAPER, quiet: bool = False) -> None:
        """Make a world at rest.

        Args:
            model: name of the world, or its model, as of `world_model`.
            quiet: do not warn when the physics becomes unstable, as for look-ahead copies.

        Raises:
            InputError: there is no such world.
        """
        self.quiet = quiet
        self.model = world_model(model)
        self.data = mujoco.MjData(self.model)
        self._tips = np.array(
            [[self.model.site(name).id for name in fingertip_sites(side)] for side in SIDES]
        )
        self.reset()

    def reset(self, qpos: ArrayLike | None = None) -> None:
        """Set positions, with all velocities 0 and the pedal up.

        Args:
            qpos: (142,) positions of keys, right and left hand, or (54,) of the hands with all
                keys up [rad, m]; None for the rest pose, in which all are 0.

        Raises:
            ValueError: `qpos` has another shape or is not finite.
        """
        start = starting_positions(qpos)
        self.blow_ups = 0
        self.pedal = False
        self._substep = 0
        self._put(start)
        self._listen()

    def step(
        self,
        ctrl: ArrayLike,
        pedal: bool = False,
        watch: Callable[[], None] | None = None,
        parts: int = 1,
    ) -> None:
        """Simulate one frame of 0.05 s, or one of the equal parts of a frame.

        Warns with `PhysicsWarning` when the physics becomes unstable, unless `quiet`.

        Args:
            ctrl: (46,) targets of the position actuators, right 23 then left 23 [rad, m];
                MuJoCo clamps them to their ranges. Or (S, 46) to be sent one after the other, each
                for as long.
            pedal: whether the sustain pedal is down.
            watch: called after each physics step, of which a frame has 10, to read `data`. From
                the step in which the physics breaks to the end of the control that is held,
                `broken` is true, and what it reads is of no world that was.
            parts: of how many equal parts of a frame one is simulated; S times `parts` divides 10.
                Parts with one control each are, bit for bit, the frame with all of them.

        Raises:
            ValueError: `ctrl` has another shape or is not finite, or a frame has no such parts.
        """
        targets = controls_of_frame(ctrl, parts, self.model.nu)
        self.pedal = bool(pedal)
        if self._substep == 0:
            self._keep_pressed_keys_awake()
        self.key_events, hold = NOTHING, SUBSTEPS // (len(targets) * parts)
        for number, target in enumerate(targets):
            self._hold(target, hold, number * hold, watch)
        self._substep = (self._substep + len(targets) * hold) % SUBSTEPS

    def _hold(
        self,
        target: NDArray[np.float64],
        substeps: int,
        done: int,
        watch: Callable[[], None] | None,
    ) -> None:
        """Hold a control for some physics steps, after others in the same step."""
        qpos, qvel = self.data.qpos, self.data.qvel
        before = qpos.copy()
        moved = np.empty((2, substeps + 1, 1, KEYS))
        moved[:, 0, 0] = qpos[:KEYS], qvel[:KEYS]
        self.data.ctrl[:] = target
        for substep in range(substeps):
            mujoco.mj_step(self.model, self.data)
            moved[:, substep + 1, 0] = qpos[:KEYS], qvel[:KEYS]
            if watch is not None:
                watch()
        if self.broken:
            self.blow_ups += 1
            if not self.quiet:
                warnings.warn(BLOW_UP, PhysicsWarning, stacklevel=3)
            events = silenced(self.sounding[None], substeps * PHYSICS_DT)
            self._put(reset_pose_after_instability(before, self.model))
        else:
            events = sense(moved[0], moved[1], self.sounding[None])
        self.key_events = self.key_events.followed_by(events.later(done * PHYSICS_DT))

    def state(self) -> NDArray[np.float64]:
        """(S,) The simulation state, for `set_state` of any World or WorldBatch.

        It is MuJoCo's full integration state; which bodies sleep is not part of it.
        """
        state = np.empty(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self.data, state, STATE)
        return state

    def set_state(self, state: ArrayLike) -> None:
        """Restore a state; the pedal is then up, `blow_ups` is 0, and pressed keys sound.

        Every World and WorldBatch that restores one state continues alike, bit for bit. The World
        that the state was taken from may continue slightly differently, because keys that slept
        there are awake here; `copy` has no such difference.

        Args:
            state: (S,) as `state` returns it.

        Raises:
            ValueError: `state` has another shape or is not finite.
        """
        given = finite(state, "state", (mujoco.mj_stateSize(self.model, STATE),))
        self.blow_ups = 0
        self.pedal = False
        self._substep = 0
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, given, STATE)
        self._listen()

    def copy(self, quiet: bool = False) -> World:
        """A world of the same model in the same state, which continues as this one, bit for bit.

        Args:
            quiet: as of a new world.
        """
        other = World(self.model, quiet)
        self._continue_in(other)
        return other

    @property
    def name(self) -> str:
        """Name of the world that its model is of, one of `WORLDS`."""
        return name_of(self.model)

    @property
    def broken(self) -> bool:
        """Whether the physics broke while a control is held; after a step it is recovered."""
        return bool(
            any(self.data.warning[kind].number for kind in RESETS)
            or not np.isfinite(self.data.qpos).all()
        )

    @property
    def fingertips(self) -> NDArray[np.float64]:
        """(2, 6, 3) World positions [m]; hands (left, right), points wrist, thumb .. little."""
        mujoco.mj_kinematics(self.model, self.data)
        tips: NDArray[np.float64] = self.data.site_xpos[self._tips]
        return tips

    def _continue_in(self, other: World) -> None:
        """Bring another world of the same model into the state of this one."""
        mujoco.mj_copyData(other.data, self.model, self.data)
        other.blow_ups, other.pedal = self.blow_ups, self.pedal
        other._substep = self._substep
        other.sounding, other.key_events = self.sounding.copy(), self.key_events

    def _listen(self) -> None:
        """Let the keys that are pressed sound, without an event."""
        self.sounding = pressed(self.data.qpos)
        self.key_events = NOTHING

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
