"""Following fingertips with a learned policy: a tracker like any other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.plan import FingertipPlan
from pianomime.policies.features import low_inputs
from pianomime.policies.horizon import CHUNK
from pianomime.policies.policy import Policy
from pianomime.track import IkTracker
from pianomime.world import World
from pianomime.world.hand import hand_points


class PolicyTracker:
    """Asks a policy for a chunk of controls in every frame anew, and plays the first of them.

    Args:
        policy: of the low level, or of one stage.
        seed: of what is drawn: with the frame, for a tracker may be asked for a frame twice.
        fingertips: whether the policy is told where fingertips are to go.
        prior: whether controls are told as what to add to those of inverse kinematics.
    """

    def __init__(
        self, policy: Policy, seed: int = 0, fingertips: bool = True, prior: bool = False
    ) -> None:
        self._policy, self._seed, self._fingertips = policy, seed, fingertips
        self._ik = IkTracker() if prior else None

    def begin(self, plan: FingertipPlan) -> None:
        """Take the plan's fingertips, and the keys that it presses as goals."""
        self._plan = plan
        self._goal = np.vstack([plan.keys(), np.zeros((CHUNK - 1, KEYS), bool)])
        if self._ik is not None:
            self._ik.begin(plan)

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left."""
        ahead = np.minimum(np.arange(frame, frame + CHUNK), len(self._plan) - 1)
        targets = self._plan.fingertips[ahead]
        return self.say(frame, world, self._goal[frame : frame + CHUNK], targets)

    def say(
        self, frame: int, world: World, goal: NDArray[np.bool_], targets: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(46,) right then left.

        Args:
            frame: which.
            world: as it is.
            goal: (4, 88) of this frame and those that follow.
            targets: (4, 2, 6, 3) where fingertips are to be in these frames [m].
        """
        prior = None if self._ik is None else self._ik.control(frame, world)
        joints = world.qpos_hands[None]
        seen = low_inputs(
            goal[None],
            targets[None] if self._fingertips else None,
            hand_points(joints),
            joints,
            world.qvel_hands[None],
            world.key_state[None],
            None if prior is None else prior[None],
        )
        draw = np.random.default_rng([self._seed, frame])
        ctrl: NDArray[np.float64] = self._policy.say(seen, draw)[0, 0].astype(np.float64)
        return ctrl if prior is None else ctrl + prior
