"""Perturbed worlds: what differs between the world that a player knows and the one it plays in."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.keyboard import KEYS
from pianomime.validation import above_zero, multiple, within
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES, world_model
from pianomime.world.parameters import PHYSICS_DT
from pianomime.world.world import World
from pianomime.world_names import PAPER

_PIANO = "piano"
"""The body that carries all keys."""
_FAR_ASIDE = 0.05
"""[m] Farther the keys are not: two keys to the side, it would be another piece."""


@dataclass(frozen=True)
class Perturbation:
    """How a world differs from the nominal one. By default it does not."""

    friction: float = 1.0
    """Factor of the friction of all contacts."""
    hand_mass: float = 1.0
    """Factor of the mass and inertia of all parts of the hands. What compensates for their weight
    stays as it is."""
    gain: float = 1.0
    """Factor of the stiffness of all position actuators."""
    key_stiffness: float = 1.0
    """Factor of the stiffness of the keys' springs."""
    keys_aside: float = 0.0
    """By how much all keys lie further to the treble [m]."""
    joint_noise: float = 0.0
    """Standard deviation of the measured angles of the hands' joints [rad]."""
    slide_noise: float = 0.0
    """Standard deviation of the measured positions of the forearms' slides [m]."""
    delay: float = 0.0
    """Time from when a control is sent to when it acts [s]; whole physics steps of 5 ms."""

    def __post_init__(self) -> None:
        """Check it.

        Raises:
            InputError: a factor is not above 0, a noise or the delay is negative, a number is not
                finite, or the delay is no whole number of physics steps.
        """
        within("keys_aside", self.keys_aside, -_FAR_ASIDE, _FAR_ASIDE)
        for name in ("friction", "hand_mass", "gain", "key_stiffness"):
            above_zero(name, getattr(self, name))
        for name in ("joint_noise", "slide_noise"):
            within(name, getattr(self, name), 0)
        multiple("delay", self.delay, PHYSICS_DT)

    @property
    def delay_steps(self) -> int:
        """The delay in physics steps."""
        return round(self.delay / PHYSICS_DT)

    def model(self, world: str | mujoco.MjModel = PAPER) -> mujoco.MjModel:
        """A perturbed copy of a model; the model itself is left as it is.

        Args:
            world: name of the world, or its model, as of `world_model`.

        Raises:
            InputError: there is no such world.
        """
        model = copy.copy(world_model(world))
        model.geom_friction[:] *= self.friction
        hands = [
            body
            for body in range(model.nbody)
            if model.body(body).name.startswith(tuple(f"{side}_" for side in SIDES))
        ]
        model.body_mass[hands] *= self.hand_mass
        model.body_inertia[hands] *= self.hand_mass
        model.body_gravcomp[hands] /= self.hand_mass
        # The spring of a position actuator pulls with gain (control - position).
        model.actuator_gainprm[:, 0] *= self.gain
        model.actuator_biasprm[:, 1] *= self.gain
        model.jnt_stiffness[:KEYS] *= self.key_stiffness
        model.body(_PIANO).pos[1] += self.keys_aside
        # Solvers scale by inverse weights in the pose of rest, which depend on the masses.
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model


class PerturbedWorld(World):
    """A world that differs from the one that players know, and in which controls act late.

    Until the first control acts, that of the rest pose does.

    Args:
        perturbation: how it differs.
        world: name of the nominal world, or its model.
        quiet: as of `World`.
    """

    def __init__(
        self,
        perturbation: Perturbation,
        world: str | mujoco.MjModel = PAPER,
        quiet: bool = False,
    ) -> None:
        self.perturbation = perturbation
        self._waiting: deque[tuple[float, ...]]
        super().__init__(perturbation.model(world), quiet)

    def reset(self, qpos: ArrayLike | None = None) -> None:
        """As `World.reset`; controls that were sent and have not acted yet are lost."""
        super().reset(qpos)
        self._forget()

    def set_state(self, state: ArrayLike) -> None:
        """As `World.set_state`; controls that were sent and have not acted yet are lost.

        They are no part of a state, `copy` has them.
        """
        super().set_state(state)
        self._forget()

    def copy(self, quiet: bool = False) -> PerturbedWorld:
        """As `World.copy`: it differs as this one does, and what was sent acts in it as well."""
        other = PerturbedWorld.__new__(PerturbedWorld)
        other.perturbation = self.perturbation
        # The model is perturbed already.
        World.__init__(other, self.model, quiet)
        self._continue_in(other)
        other._waiting = self._waiting.copy()
        return other

    def _forget(self) -> None:
        """Have the control of the rest pose act until the first one that is sent now does."""
        rest = (0.0,) * LAYOUT.ctrl_size
        self._waiting = deque([rest] * self.perturbation.delay_steps)

    def _hold(
        self,
        target: NDArray[np.float64],
        substeps: int,
        done: int,
        watch: Callable[[], None] | None,
    ) -> None:
        """Send a control for some physics steps, and hold what acts in them."""
        self._waiting.extend([tuple(target.tolist())] * substeps)
        acting = [self._waiting.popleft() for _ in range(substeps)]
        for control, steps in groupby(acting):
            count = len(list(steps))
            super()._hold(np.array(control), count, done, watch)
            done += count


class Sensors:
    """Measures the joints of the hands in a world, with the noise of a perturbation.

    Args:
        perturbation: how noisy they are.
        seed: of the noise.

    Attributes:
        joint_noise: standard deviation of the measured angles [rad].
    """

    def __init__(self, perturbation: Perturbation, seed: int = 0) -> None:
        self.joint_noise = perturbation.joint_noise
        one = np.full(LAYOUT.hand_joints, self.joint_noise)
        one[LAYOUT.slides] = perturbation.slide_noise
        self._spread = np.tile(one, len(SIDES))
        self._rng = np.random.default_rng(seed)

    def measure(self, world: World) -> NDArray[np.float64]:
        """(54,) Measured positions of the hands, right 27 then left 27 [rad, m]; noise is new."""
        noise: NDArray[np.float64] = self._spread * self._rng.standard_normal(LAYOUT.hands_size)
        return world.qpos_hands + noise
