"""A learned policy as a tracker: it outputs a chunk of controls in every frame anew."""

from __future__ import annotations

import copy
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.plan import FingertipPlan
from pianomime.policies.features import tracking_observation
from pianomime.policies.horizon import CHUNK
from pianomime.policies.policy import Policy
from pianomime.track import IkTracker
from pianomime.world import World
from pianomime.world.hand import hand_points


class PolicyTracker:
    """Asks a policy for a chunk of controls in every frame, and plays the first of them.

    Args:
        policy: a low-level policy, or one that goes from goals to controls.
        seed: of the policy's sampling. Together with the frame it seeds every frame anew, so that
            the controller is replayable.
        fingertips: whether the policy observes the targets of the fingertips.
        residual: whether the policy outputs a residual that is added to inverse kinematics.
    """

    def __init__(
        self, policy: Policy, seed: int = 0, fingertips: bool = True, residual: bool = False
    ) -> None:
        self._policy, self._seed, self._fingertips = policy, seed, fingertips
        self._ik = IkTracker() if residual else None

    def seeded(self, seed: int) -> PolicyTracker:
        """The same policy with another seed of its sampling; nothing is loaded again."""
        other = copy.copy(self)
        other._seed = seed
        return other

    def start(self, plan: FingertipPlan) -> PolicyController:
        """A controller whose goals are the keys that the plan presses."""
        return PolicyController(plan, self)

    def act(
        self, frame: int, world: World, goal: NDArray[np.bool_], targets: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The control of one frame.

        Args:
            frame: its number, for the seed.
            world: as it is before the frame.
            goal: (4, 88) goals of this frame and the next.
            targets: (4, 2, 6, 3) points of the hands wanted in these frames [m].

        Returns:
            (46,) right then left [rad, m].
        """
        joints = world.qpos_hands[None]
        base = None if self._ik is None else self._ik.solve(world.qpos[None], targets[:1])[0]
        observation = tracking_observation(
            goal[None],
            targets[None] if self._fingertips else None,
            hand_points(joints),
            joints,
            world.qvel_hands[None],
            world.key_state[None],
            base,
        )
        rng = np.random.default_rng([self._seed, frame])
        ctrl: NDArray[np.float64] = self._policy.act(observation, rng)[0, 0].astype(np.float64)
        return ctrl if base is None else ctrl + base[0]


class PolicyController:
    """Follows a whole plan with a policy.

    Args:
        plan: what is followed.
        tracker: whose policy acts.
        goal: (T, 88) bool, the keys that should be down; those that the plan presses if None.
    """

    replayable: ClassVar[bool] = True

    def __init__(
        self,
        plan: FingertipPlan,
        tracker: PolicyTracker,
        goal: NDArray[np.bool_] | None = None,
    ) -> None:
        self.plan = plan
        self._tracker = tracker
        wanted = plan.keys() if goal is None else goal
        self._goal = np.vstack([wanted, np.zeros((CHUNK - 1, KEYS), bool)])

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left [rad, m]."""
        ahead = np.minimum(np.arange(frame, frame + CHUNK), len(self.plan) - 1)
        goal = self._goal[frame : frame + CHUNK]
        return self._tracker.act(frame, world, goal, self.plan.fingertips[ahead])
