"""Receding-horizon rollout of the high-level fingertip policy, and a planner of whole songs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS, NO_KEY
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.plan.hand_path import make_feasible
from pianomime.policies.features import fingertip_observation, rest_points, to_world_frame
from pianomime.policies.finger_assignment import assign_fingers, flat_heights
from pianomime.policies.horizon import CHUNK, GOAL_HORIZON
from pianomime.policies.policy import Policy
from pianomime.progress import Steps
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
        self._goal = np.vstack([score.roll(), np.zeros((GOAL_HORIZON, KEYS), bool)])
        self._policy, self._rng = policy, np.random.default_rng(seed)
        self._points = rest_points()
        self._pressing = no_keys()
        self.plan = PlanRecord(score)

    def step(self, frame: int) -> NDArray[np.float64]:
        """(4, 2, 6, 3) points [m] wanted in this frame and the next; frames come in order."""
        observation = fingertip_observation(
            self._goal[None, frame : frame + GOAL_HORIZON], self._points[None]
        )
        action = self._policy.act(observation, self._rng)[0].reshape(-1, 2, POINT_COUNT, 3)
        points = to_world_frame(action.astype(np.float64))
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


@dataclass(frozen=True)
class LearnedPlannerConfig:
    """How predicted fingertips are followed."""

    feasible: bool = True
    """Predict the whole song, and move fingertips to where the robot's hands can be, see
    `make_feasible`; otherwise they are predicted while it is played, and followed as they are."""


class LearnedPlanner:
    """Plans a whole song before it is played, as the published code does.

    Args:
        policy: the fingertip policy.
        seed: of its sampling.
        config: whether fingertips are made feasible.
    """

    def __init__(
        self, policy: Policy, seed: int = 0, config: LearnedPlannerConfig | None = None
    ) -> None:
        self._policy, self._seed = policy, seed
        self._config = config or LearnedPlannerConfig()

    def plan(self, score: Score) -> FingertipPlan:
        """One row for each frame of `score.roll()`."""
        rollout, steps = FingertipRollout(score, self._policy, self._seed), score.frames()
        told = Steps("fingertips", steps)
        for frame in range(steps):
            rollout.step(frame)
            told.advance(1)
        plan = rollout.plan.plan()
        return feasible_targets(plan) if self._config.feasible else plan


def feasible_targets(plan: FingertipPlan) -> FingertipPlan:
    """A plan with fingertips where the robot's hands can be, as low-level policies follow it.

    Args:
        plan: the fingertips of a human, or of a high-level policy.

    Returns:
        The same fingers on the same keys, see `make_feasible`, with heights that tell alone which
        fingers press, see `flat_heights`.
    """
    feasible = make_feasible(plan)
    return replace(feasible, fingertips=flat_heights(feasible.fingertips, feasible.finger_key))


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
