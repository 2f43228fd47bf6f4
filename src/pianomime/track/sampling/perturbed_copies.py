"""Perturbed copies: worlds that differ a little, in which controls are replayed as they are.

Controls that were chosen among many because they go well in one world may fail in the next. Those
that are tried in some others as well, as in domain randomization, fail less.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS, KEYS
from pianomime.track.heard import Frame, strikes_in
from pianomime.track.sampling.cost import Cost
from pianomime.track.sampling.rollouts import Rollouts, Start
from pianomime.world import World
from pianomime.world.perturbation import Perturbation

COPIES = (
    Perturbation(friction=0.7, hand_mass=1.1, gain=0.9, key_stiffness=1.2, keys_aside=0.002),
    Perturbation(friction=1.3, gain=1.1, key_stiffness=0.8, keys_aside=-0.002),
    Perturbation(friction=0.7, gain=1.1),
)
"""How copies differ, of which the first ones are taken: weak hands that slip, with keys to the one
side; strong hands that stick, with keys to the other; and strong hands that slip."""


class PerturbedCopy:
    """A copy of the world that differs, and follows what is played in the nominal one.

    Nothing in it is looked at to find controls: it does what their replay does, open loop.

    Attributes:
        world: the copy, in the state before the first frame that it has not followed yet.
        cost: of what is heard in it.
        rollouts: of controls in it.

    Args:
        perturbation: how it differs.
        world: name of the nominal world.
        cost: of what is heard in it, given what was heard in it before; it is its own.
        goal: (T, 88) bool, the keys that should be down at the end of each frame.
        most: number of controls that are rolled out side by side.
        threads: how many step at the same time; 0 for one on each core.
    """

    def __init__(
        self,
        perturbation: Perturbation,
        world: str,
        cost: Cost,
        goal: NDArray[np.bool_],
        most: int,
        threads: int,
    ) -> None:
        self.world = World(perturbation.model(world), quiet=True)
        self.cost = cost
        self.rollouts = Rollouts(cost, goal, most, threads, world, perturbation)
        self._followed = 0

    @property
    def steps(self) -> int:
        """Number of frames that were simulated so far."""
        return self._followed + self.rollouts.steps

    def start(self, first: int, ctrl: NDArray[np.float64]) -> Start:
        """Whence controls are rolled out in it; what is known there is what is heard of some.

        Args:
            first: number of the first frame.
            ctrl: (H, S, 46) these controls.
        """
        silence = [Frame([], np.zeros(KEYS, bool))] * len(ctrl)
        start = self.rollouts.start(first, self.world, silence)
        return start._replace(known=self.rollouts.best(start, ctrl[None]).heard)

    def follow(self, first: int, ctrl: Sequence[NDArray[np.float64]]) -> None:
        """Play what is played in the nominal world.

        Args:
            first: number of the first frame.
            ctrl: (S, 46) the controls of each frame.
        """
        for frame, target in enumerate(ctrl, first):
            self.world.step(target)
            self.cost.heard(strikes_in(self.world.key_events, frame * FRAME_SECONDS))
            self._followed += 1
