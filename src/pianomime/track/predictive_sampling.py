"""Improve a tracker's controls by trying variations of them before they are played.

The tracker is followed a little way ahead in a copy of the world. Where keys would go wrong,
variations of its controls are rolled out side by side, and the best is taken (predictive
sampling, with a good first guess). Where nothing goes wrong it costs one rollout.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.plan import FingertipPlan
from pianomime.track.tracker import Tracker
from pianomime.world import World, WorldBatch
from pianomime.world.hand import Hand, by_actuator
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES
from pianomime.world.parameters import key_centres

# Actuators of a hand: wrist and forearm.
_ARM = [0, 1, 20, 21, 22]


@dataclass(frozen=True)
class PredictiveSamplingConfig:
    """How hard to try."""

    variations: int = 16
    """Variations that are rolled out side by side."""
    rounds: int = 2
    """Times that variations of the best so far are drawn: more of these gain more than more
    variations in each."""
    commit: int = 4
    """Frames that are played before looking ahead again."""
    ahead: int = 8
    """Frames that are looked ahead."""
    knots: int = 4
    """Frames between the points that a variation is drawn at."""
    joint: float = 0.2
    """[rad] Standard deviation of a variation, of finger joints;"""
    wrist: float = 0.06
    """[rad] of the wrist;"""
    slide: float = 0.006
    """[m] of the forearm."""
    blamed: float = 0.7
    """Chance that an actuator of a finger that goes wrong is varied;"""
    arm: float = 0.3
    """of its wrist and forearm;"""
    others: float = 0.1
    """of the hand's other fingers."""
    seed: int = 0
    """Of what is drawn."""

    @classmethod
    def of_effort(cls, effort: int) -> PredictiveSamplingConfig:
        """The settings of efforts 1 to 3: each tries several times as much as the one before."""
        return {
            1: cls(),
            2: cls(rounds=6),
            3: cls(variations=32, rounds=12),
        }[effort]


class PredictiveSamplingTracker:
    """Plays what another tracker would, but for the variations that hit more keys.

    The other tracker is asked for frames ahead of time, more than once, on copies of the world:
    its controls must depend on plan, frame and world alone.

    Attributes:
        steps: control steps that were simulated to look ahead since the last `begin`.

    Args:
        tracker: whose controls to improve.
        config: how hard to try.
        goal: (T, 88) bool, the keys that should be down; those that the plan presses if None.
        threads: how many variations step at the same time; 0 for one on each core.
    """

    def __init__(
        self,
        tracker: Tracker,
        config: PredictiveSamplingConfig | None = None,
        goal: NDArray[np.bool_] | None = None,
        threads: int = 0,
    ) -> None:
        self.config = config or PredictiveSamplingConfig()
        self.steps = 0
        self._asked = goal
        self._threads = threads
        self._tracker = tracker
        self._hands = [Hand(side) for side in SIDES]
        size = self.config
        self._spread = by_actuator(size.joint, size.wrist, size.slide)

    def begin(self, plan: FingertipPlan) -> None:
        """Prepare the tracker; draw the same variations for the same plan."""
        self._tracker.begin(plan)
        self._batch = WorldBatch(self.config.variations, self._threads, quiet=True)
        self._goal = plan.keys() if self._asked is None else self._asked
        self._finger_key = plan.finger_key
        self._along = plan.fingertips[:, :, 1:, 1]
        self._rng = np.random.default_rng(self.config.seed)
        self.steps = 0
        self._ctrl: list[NDArray[np.float64]] = []

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) the control found for this frame."""
        if not self._ctrl:
            self._ctrl = list(self._search(frame, world)[: self.config.commit])
        return self._ctrl.pop(0)

    def _search(self, frame: int, world: World) -> NDArray[np.float64]:
        """Controls (H, 46) of the next frames."""
        goal = self._goal[frame : frame + self.config.ahead]
        ahead = world.copy(quiet=True)
        ctrl = np.empty((len(goal), world.model.nu))
        pressed = np.empty_like(goal)
        for step in range(len(goal)):
            ctrl[step] = self._tracker.control(frame + step, ahead)
            ahead.step(ctrl[step])
            pressed[step] = ahead.pressed
        self.steps += len(goal)
        wrong = pressed != goal
        if not wrong[: self.config.commit + 2].any():
            return ctrl
        moment = world.state()
        chance = self._chances(frame, wrong)
        for _ in range(self.config.rounds):
            tries = ctrl + self._variations(len(goal), chance)
            tries[0] = ctrl
            cost = self._cost(moment, tries, goal)
            ctrl = tries[int(np.argmin(cost))]
        return ctrl

    def _cost(
        self,
        moment: NDArray[np.float64],
        ctrl: NDArray[np.float64],
        goal: NDArray[np.bool_],
    ) -> NDArray[np.float64]:
        """(B,) what each of the controls (B, H, 46) does wrong from a moment on."""
        self._batch.set_state(moment)
        self.steps += len(ctrl) * len(goal)
        cost = np.zeros(len(ctrl))
        for step in range(len(goal)):
            self._batch.step(ctrl[:, step])
            wrong = self._batch.pressed != goal[step]
            # Keys that are nearly right are better than keys that are not.
            short = np.abs(self._batch.key_state - goal[step])
            cost += wrong.sum(axis=1) + 0.1 * short.sum(axis=1)
        return cost + 100.0 * self._batch.blow_ups

    def _chances(self, frame: int, wrong: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(46,) how likely each actuator is varied, given the keys (H, 88) that go wrong.

        Mostly those of the fingers that miss a key or are nearest to one that is hit.
        """
        chance = np.zeros(46)
        for step, key in np.argwhere(wrong):
            players = np.argwhere(self._finger_key[frame + step] == key)
            if not len(players):
                away = np.abs(self._along[frame + step] - key_centres()[key, 1])
                players = np.argwhere(away == away.min())
            for index, finger in players:
                mine = chance[self._hands[index].actuators]
                np.maximum(mine, self.config.others, out=mine)
                mine[_ARM] = np.maximum(mine[_ARM], self.config.arm)
                mine[LAYOUT.finger_actuators[finger]] = self.config.blamed
        return chance

    def _variations(self, frames: int, chance: NDArray[np.float64]) -> NDArray[np.float64]:
        """(B, frames, 46) smooth random additions to the controls."""
        points = np.arange(0, frames + self.config.knots, self.config.knots)
        drawn = self._rng.standard_normal((self.config.variations, len(points), 46)) * self._spread
        drawn *= self._rng.random((self.config.variations, 1, 46)) < chance
        at = np.arange(frames)
        low = at // self.config.knots
        share = ((at % self.config.knots) / self.config.knots)[:, None]
        smooth: NDArray[np.float64] = drawn[:, low] * (1 - share) + drawn[:, low + 1] * share
        return smooth
