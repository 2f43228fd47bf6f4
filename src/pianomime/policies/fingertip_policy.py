"""What a high level wants, frame after frame, and a planner that wants a whole song ahead."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS, NO_KEY
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.policies.features import high_inputs, rest_tips, to_world
from pianomime.policies.finger_assignment import assign_fingers
from pianomime.policies.horizon import CHUNK, HIGH_GOALS
from pianomime.policies.policy import Policy


class FingertipRollout:
    """Goes on, every frame, from where it last wanted the fingertips.

    Attributes:
        goal: (T + 10, 88) what the score wants, and silence.
        tips: (2, 6, 3) where it wants points in the frame that it was asked for last [m].
        pressing: (2, 5) the key that each finger presses there, -1 for none.

    Args:
        score: what is played.
        high: says fingertips.
        seed: of what is drawn.
    """

    def __init__(self, score: Score, high: Policy, seed: int = 0) -> None:
        self.goal = np.vstack([score.roll(), np.zeros((HIGH_GOALS, KEYS), bool)])
        self.tips = rest_tips().copy()
        self.pressing = np.full((2, 5), NO_KEY, np.int8)
        self._high, self._draw = high, np.random.default_rng(seed)

    def ahead(self, frame: int) -> NDArray[np.float64]:
        """(4, 2, 6, 3) points that it wants in this frame and the next; frames come in order."""
        seen = high_inputs(self.goal[None, frame : frame + HIGH_GOALS], self.tips[None])
        told = self._high.say(seen, self._draw)[0].reshape(-1, 2, 6, 3)
        said = to_world(told.astype(np.float64))
        targets, pressing = np.empty((CHUNK, 2, 6, 3)), self.pressing
        for ahead in range(CHUNK):
            targets[ahead], pressing = assign_fingers(
                said[ahead], self.goal[frame + ahead], pressing
            )
            if ahead == 0:
                self.pressing = pressing
        self.tips = targets[0]
        return targets


class LearnedPlanner:
    """Plans a whole song before it is played, as the published code does.

    Args:
        high: says fingertips.
        seed: of what is drawn.
    """

    def __init__(self, high: Policy, seed: int = 0) -> None:
        self._high, self._seed = high, seed

    def plan(self, score: Score) -> FingertipPlan:
        """One row for each frame of `score.roll()`."""
        wanting, plan = FingertipRollout(score, self._high, self._seed), empty_plan(score)
        for frame in range(len(plan)):
            wanting.ahead(frame)
            plan.fingertips[frame], plan.finger_key[frame] = wanting.tips, wanting.pressing
        name_fingers(plan, score)
        return plan


def empty_plan(score: Score) -> FingertipPlan:
    """A plan at rest, to be written into."""
    frames, none = score.frames(), np.full(len(score), -1, np.int8)
    return FingertipPlan(
        np.tile(rest_tips(), (frames, 1, 1, 1)),
        np.full((frames, 2, 5), NO_KEY, np.int8),
        none,
        none.copy(),
    )


def name_fingers(plan: FingertipPlan, score: Score) -> None:
    """Write who plays them into a plan: for each note the first finger that presses its key."""
    notes = zip(score.key, *score.note_frames().T, strict=True)
    for note, (key, first, end) in enumerate(notes):
        played = np.argwhere(plan.finger_key[first:end] == key)
        if len(played):
            plan.note_hand[note], plan.note_finger[note] = played[0, 1:]
