"""The high-level fingertip policy, rolled out frame by frame on its own predictions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS, NO_KEY
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.policies.features import fingertip_observation, rest_points, to_world_frame
from pianomime.policies.finger_assignment import assign_fingers
from pianomime.policies.horizon import CHUNK, GOAL_HORIZON
from pianomime.policies.policy import Policy
from pianomime.world.layout import FINGER_COUNT, POINT_COUNT


class FingertipRollout:
    """Runs the fingertip policy frame after frame, each from its own output for the frame before.

    Attributes:
        plan: the frames so far; later ones are at rest.

    Args:
        score: what is played.
        policy: the fingertip policy.
        seed: of its sampling.
    """

    def __init__(self, score: Score, policy: Policy, seed: int = 0) -> None:
        self._goal = goals_ahead(score)
        self._policy, self._rng = policy, np.random.default_rng(seed)
        self._points = rest_points()
        self._pressing = no_keys()
        self.plan = PlanRecord(score)

    def step(self, frame: int) -> NDArray[np.float64]:
        """(4, 2, 6, 3) points [m] wanted in this frame and the next; frames come in order.

        Args:
            frame: its number.
        """
        goals = self._goal[frame : frame + GOAL_HORIZON]
        points = predict_points(self._policy, goals, self._points[None], self._rng)[0]
        targets, pressing = np.empty((CHUNK, 2, POINT_COUNT, 3)), self._pressing
        for ahead in range(CHUNK):
            targets[ahead], pressing = assign_fingers(
                points[ahead], self._goal[frame + ahead], pressing
            )
            if ahead == 0:
                self._pressing = pressing
        self._points = targets[0]
        self.plan.write(frame, self._points, self._pressing)
        return targets


def goals_ahead(score: Score) -> NDArray[np.bool_]:
    """(T + 10, 88) goals of a score, and silence as far as the policy sees beyond its end."""
    return np.vstack([score.roll(), np.zeros((GOAL_HORIZON, KEYS), bool)])


def predict_points(
    policy: Policy,
    goals: NDArray[np.bool_],
    points: NDArray[np.float64],
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """(N, 4, 2, 6, 3) points that a policy predicts for a frame and the next, world frame [m].

    Args:
        policy: the fingertip policy.
        goals: (10, 88) of the frame and the next.
        points: (N, 2, 6, 3) of N candidates in the frame before [m].
        rng: of the sampling.
    """
    observation = fingertip_observation(np.repeat(goals[None], len(points), axis=0), points)
    action = policy.act(observation, rng).reshape(len(points), -1, 2, POINT_COUNT, 3)
    return np.asarray(to_world_frame(action.astype(np.float64)), np.float64)


class PlanRecord:
    """A plan that becomes known frame by frame, at rest where it is not known yet.

    Args:
        score: what is played.
    """

    def __init__(self, score: Score) -> None:
        self._score = score
        self._points = np.tile(rest_points(), (score.frames(), 1, 1, 1))
        self._finger_key = np.tile(no_keys(), (score.frames(), 1, 1))

    def write(self, frame: int, points: NDArray[np.float64], finger_key: NDArray[np.int8]) -> None:
        """Write one frame.

        Args:
            frame: its number.
            points: (2, 6, 3) of the hands [m].
            finger_key: (2, 5) the key that each finger presses, -1 for none.
        """
        self._points[frame], self._finger_key[frame] = points, finger_key

    def plan(self) -> FingertipPlan:
        """The plan so far; each note is played by the first finger that presses its key."""
        hand = np.full(len(self._score), -1, np.int8)
        finger = hand.copy()
        notes = zip(self._score.key, *self._score.note_frames().T, strict=True)
        for note, (key, first, end) in enumerate(notes):
            played = np.argwhere(self._finger_key[first:end] == key)
            if len(played):
                hand[note], finger[note] = played[0, 1:]
        return FingertipPlan(self._points.copy(), self._finger_key.copy(), hand, finger)


def no_keys() -> NDArray[np.int8]:
    """(2, 5) keys of fingers that press nothing."""
    return np.full((2, FINGER_COUNT), NO_KEY, np.int8)
