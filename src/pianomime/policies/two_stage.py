"""A generalist plays: what it wants, and how it does it, decided anew as it goes.

It is planner and tracker in one. Its plan is written while it plays: every frame the high level
goes on from where it last wanted the fingertips, and the low level looks at the hands as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS, NO_KEY
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.policies.finger_assignment import assign_fingers
from pianomime.policies.fingertip_policy import FingertipRollout, empty_plan, name_fingers
from pianomime.policies.horizon import CHUNK
from pianomime.policies.policy import Policy
from pianomime.policies.policy_tracker import PolicyTracker
from pianomime.world import World
from pianomime.world.hand import hand_points


class Generalist:
    """Plays any score with one policy, or with two, the first of which says where fingertips go.

    Args:
        follower: says controls.
        high: says fingertips; None for a policy of one stage.
        seed: of what is drawn; the same seed plays the same.
    """

    def __init__(self, follower: PolicyTracker, high: Policy | None, seed: int = 0) -> None:
        self._follower, self._high, self._seed = follower, high, seed

    def plan(self, score: Score) -> FingertipPlan:
        """A plan at rest, for now; what is played is written into it."""
        self._score = score
        return empty_plan(score)

    def begin(self, plan: FingertipPlan) -> None:
        """Start anew at the first frame of a plan that `plan` made."""
        self._plan = plan
        self._goal = np.vstack([self._score.roll(), np.zeros((CHUNK, KEYS), bool)])
        self._pressing = np.full((2, 5), NO_KEY, np.int8)
        self._wanting = (
            None if self._high is None else FingertipRollout(self._score, self._high, self._seed)
        )
        self._follower.begin(plan)

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left; frames are asked for one after the other."""
        plan = self._plan
        if self._wanting is None:
            # Nothing was planned: what is nearest is taken for what presses.
            tips = hand_points(world.qpos_hands[None])[0]
            _, self._pressing = assign_fingers(tips, self._goal[frame], self._pressing)
            plan.fingertips[frame], plan.finger_key[frame] = tips, self._pressing
            targets = np.repeat(tips[None], CHUNK, axis=0)
        else:
            targets = self._wanting.ahead(frame)
            plan.fingertips[frame] = self._wanting.tips
            plan.finger_key[frame] = self._wanting.pressing
        if frame == len(plan) - 1:
            name_fingers(plan, self._score)
        return self._follower.say(frame, world, self._goal[frame : frame + CHUNK], targets)
