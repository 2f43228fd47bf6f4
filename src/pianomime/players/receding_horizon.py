"""The receding-horizon player: it plans some seconds, plays them, and plans on from where it is.

It begins to play as soon as the first seconds are planned, however long the piece is. Fingering
alone is found for the whole piece before it begins.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, FRAME_SECONDS
from pianomime.music import Score
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.plan.strikes import Strikes
from pianomime.plan.zero_shot import GrowingPlan
from pianomime.players.player import PlannedPlayer
from pianomime.track import KeystrokeTracker
from pianomime.track.keystroke import KeystrokeController
from pianomime.validation import above_zero, finite, within
from pianomime.world import World


@dataclass(frozen=True)
class HorizonConfig:
    """How far is planned at a time."""

    first: float = 4.0
    """First stretch that is planned [s]; each stretch is twice as long as the one before."""
    longest: float = 32.0
    """Longest stretch [s]."""
    ahead: float = 3.0
    """Music after each stretch that its plan takes into account [s]."""

    def __post_init__(self) -> None:
        finite(self)
        above_zero("first", self.first)
        within("longest", self.longest, self.first)
        within("ahead", self.ahead, 0.0)


@dataclass(frozen=True, repr=False)
class RecedingHorizonPlayer(PlannedPlayer):
    """A planner and a tracker that take turns.

    Attributes:
        planner: whose plans can grow.
        tracker: that can begin in the middle of a piece.
        horizon: how far is planned at a time.
    """

    planner: ZeroShotPlanner
    tracker: KeystrokeTracker
    horizon: HorizonConfig = field(default_factory=HorizonConfig)

    def start(self, score: Score) -> RecedingHorizonController:
        """Find the fingering of the whole score, and plan its first stretch."""
        return RecedingHorizonController(self.planner.begin(score), self.tracker, self.horizon)


class RecedingHorizonController:
    """Follows a plan that grows while it is followed.

    It keeps the controls of one stretch alone, so it must be asked in order: it is not replayable.

    Args:
        growing: what is followed.
        tracker: that follows it.
        config: how far is planned at a time.
    """

    replayable = False

    def __init__(
        self, growing: GrowingPlan, tracker: KeystrokeTracker, config: HorizonConfig
    ) -> None:
        self._growing, self._tracker, self._config = growing, tracker, config
        self._frames = len(growing.plan)
        self._length = config.first
        self._x = np.empty(len(_strikes(growing.plan)))
        self._first = 0
        self._stretch = self._follow(None)

    @property
    def plan(self) -> FingertipPlan:
        """What is followed; hands are at rest in frames that are not planned yet."""
        return self._growing.plan

    @property
    def controls_per_frame(self) -> int:
        """Number of controls that follow one another in a frame."""
        return self._tracker.config.controls

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) as `KeystrokeController.control`; the next stretch is planned when it begins."""
        if frame >= self._growing.planned * self.controls_per_frame:
            before = self._stretch.poses_before(self._growing.planned - self._first)
            self._first = self._growing.planned
            self._stretch = self._follow(before)
        return self._stretch.control(frame - self._first * self.controls_per_frame, world)

    def _follow(self, before: list[NDArray[np.float64]] | None) -> KeystrokeController:
        """Plan a stretch; what controls it, and what comes just after it."""
        ahead = round(self._config.ahead * FRAME_RATE)
        stop = min(self._first + max(1, round(self._length * FRAME_RATE)), self._frames)
        self._length = min(2 * self._length, self._config.longest)
        self._growing.extend(stop, ahead)
        plan, here = self._growing.plan, slice(self._first, stop + ahead)
        began, ends = self._first * FRAME_SECONDS, (stop + ahead) * FRAME_SECONDS
        strikes, stroke = _strikes(plan), self._tracker.config.stroke
        takes = stroke.longest + stroke.settle
        chosen = np.flatnonzero(
            (strikes.release + stroke.rise > began) & (strikes.onset - takes < ends)
        )
        fingertips = plan.fingertips[here]
        held = chosen[strikes.onset[chosen] < began]
        if len(held):
            # A finger that is on its key stays where it struck it.
            fingertips = fingertips.copy()
            fingertips[0, strikes.hand[held], 1 + strikes.finger[held], 0] = self._x[held]
        stretch = replace(
            plan,
            fingertips=fingertips,
            finger_key=plan.finger_key[here],
            strikes=strikes.some(chosen, since=began),
        )
        controller = self._tracker.start(stretch, before)
        self._x[chosen] = controller.x
        return controller


def _strikes(plan: FingertipPlan) -> Strikes:
    assert plan.strikes is not None  # the plans of `ZeroShotPlanner` have them
    return plan.strikes
