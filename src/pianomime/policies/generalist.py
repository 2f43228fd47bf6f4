"""Generalists frame by frame: fingertips are predicted while controls are played."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.policies.finger_assignment import assign_fingers
from pianomime.policies.fingertip_policy import FingertipRollout, PlanRecord, no_keys
from pianomime.policies.horizon import CHUNK
from pianomime.policies.policy import Policy
from pianomime.policies.policy_tracker import PolicyTracker
from pianomime.world import World
from pianomime.world.hand import hand_points


class TwoStageController:
    """A high-level policy outputs fingertips, a low-level policy the controls that reach them.

    Args:
        score: what is played.
        high: the fingertip policy.
        low: the tracker of the low-level policy.
        seed: of the fingertip policy's sampling.
    """

    replayable: ClassVar[bool] = False

    def __init__(self, score: Score, high: Policy, low: PolicyTracker, seed: int = 0) -> None:
        self._goal = _goal(score)
        self._low, self._rollout = low, FingertipRollout(score, high, seed)

    @property
    def plan(self) -> FingertipPlan:
        """The fingertips that the high-level policy has wanted so far."""
        return self._rollout.plan.plan()

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left [rad, m]; frames come in order, each once."""
        targets = self._rollout.step(frame)
        return self._low.act(frame, world, self._goal[frame : frame + CHUNK], targets)


class OneStageController:
    """One policy goes from goals straight to controls.

    Args:
        score: what is played.
        policy: the tracker of the policy.
    """

    replayable: ClassVar[bool] = False

    def __init__(self, score: Score, policy: PolicyTracker) -> None:
        self._goal = _goal(score)
        self._policy, self._record = policy, PlanRecord(score)
        self._pressing = no_keys()

    @property
    def plan(self) -> FingertipPlan:
        """Where the hands were so far, and whom `assign_fingers` gave each key: no policy did."""
        return self._record.plan()

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left [rad, m]; frames come in order, each once."""
        points = hand_points(world.qpos_hands[None])[0]
        _, self._pressing = assign_fingers(points, self._goal[frame], self._pressing)
        self._record.write(frame, points, self._pressing)
        targets = np.repeat(points[None], CHUNK, axis=0)
        return self._policy.act(frame, world, self._goal[frame : frame + CHUNK], targets)


def _goal(score: Score) -> NDArray[np.bool_]:
    """(T + 4, 88) the score's goals, and silence."""
    return np.vstack([score.roll(), np.zeros((CHUNK, KEYS), bool)])
