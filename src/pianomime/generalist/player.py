"""A generalist plays: what it wants, and how it does it, decided anew as it goes.

It is planner and tracker in one. Its plan is written while it plays: every frame the high level
goes on from where it last wanted the fingertips, and the low level looks at the hands as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.generalist.features import high_inputs, rest_tips, to_world
from pianomime.generalist.follower import Follower
from pianomime.generalist.horizon import CHUNK, HIGH_GOALS
from pianomime.generalist.policy import Policy
from pianomime.generalist.snap import snap
from pianomime.music import Score
from pianomime.plan import NO_KEY, FingertipPlan
from pianomime.world import World
from pianomime.world.figures import KEYS


class Generalist:
    """Plays any score with one policy, or with two, the first of which says where fingertips go.

    Args:
        follower: says controls.
        high: says fingertips; None for a policy of one stage.
        seed: of what is drawn; the same seed plays the same.
    """

    def __init__(self, follower: Follower, high: Policy | None, seed: int = 0) -> None:
        self._follower, self._high, self._seed = follower, high, seed

    def plan(self, score: Score) -> FingertipPlan:
        """A plan at rest, for now; what is played is written into it."""
        goal = score.roll()
        self._goal = np.vstack([goal, np.zeros((HIGH_GOALS, KEYS), bool)])
        self._notes = np.array([score.key, *score.note_frames().T]).T
        none = np.full(len(score), -1, np.int8)
        tips = np.tile(rest_tips(), (len(goal), 1, 1, 1))
        return FingertipPlan(tips, np.full((len(goal), 2, 5), NO_KEY, np.int8), none, none.copy())

    def begin(self, plan: FingertipPlan) -> None:
        """Start anew at the first frame of a plan that `plan` made."""
        self._plan = plan
        self._draw = np.random.default_rng(self._seed)
        self._wanted = rest_tips().copy()
        self._pressing = np.full((2, 5), NO_KEY, np.int8)
        self._follower.begin(plan)

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left; frames are asked for one after the other."""
        targets = self._look_ahead(frame, self._follower.points(world))
        return self._follower.say(frame, world, self._goal[frame : frame + CHUNK], targets)

    def _look_ahead(self, frame: int, tips: NDArray[np.float64]) -> NDArray[np.float64]:
        """The points (4, 2, 6, 3) of this frame and the next, and into the plan with the first."""
        plan = self._plan
        if self._high is None:
            # Nothing was planned: what is nearest is taken for what presses.
            _, self._pressing = snap(tips, self._goal[frame], self._pressing)
            plan.fingertips[frame] = tips
            targets = np.repeat(tips[None], CHUNK, axis=0)
        else:
            seen = high_inputs(self._goal[None, frame : frame + HIGH_GOALS], self._wanted[None])
            told = self._high.say(seen, self._draw)[0].reshape(-1, 2, 6, 3)
            said = to_world(told.astype(np.float64))
            targets, pressing = np.empty((CHUNK, 2, 6, 3)), self._pressing
            for ahead in range(CHUNK):
                targets[ahead], pressing = snap(said[ahead], self._goal[frame + ahead], pressing)
                if ahead == 0:
                    self._pressing = pressing
            self._wanted = plan.fingertips[frame] = targets[0]
        plan.finger_key[frame] = self._pressing
        self._name_fingers(frame)
        return targets

    def _name_fingers(self, frame: int) -> None:
        """Write who plays them into the plan, for notes that somebody begins to play."""
        plan, (key, first, end) = self._plan, self._notes.T
        for note in np.flatnonzero((first <= frame) & (frame < end) & (plan.note_hand < 0)):
            for hand, finger in np.argwhere(self._pressing == key[note])[:1]:
                plan.note_hand[note], plan.note_finger[note] = hand, finger
