"""The receding-horizon player: it plans some seconds, plays them, and plans on from there.

It begins to play as soon as the first seconds are planned. The fingering alone is found for the
whole piece before it begins, which takes some 5 ms a note.
"""

from __future__ import annotations

import math
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
from pianomime.track.keystroke import Continuation, KeystrokeController
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
    """Music after each stretch that its plan takes into account [s]; at least a stroke is."""

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
        self._x = np.full(len(_strikes(growing.plan)), np.nan)
        self._begin = 0
        self._stretch = self._follow(None)

    @property
    def plan(self) -> FingertipPlan:
        """What is followed, see `GrowingPlan.plan`."""
        return self._growing.plan

    @property
    def controls_per_frame(self) -> int:
        """Number of controls that follow one another in a frame."""
        return self._tracker.config.controls

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) as `KeystrokeController.control`; the next stretch is planned when it begins."""
        if frame >= self._growing.planned * self.controls_per_frame:
            paths = self._stretch.paths_about(self._growing.planned - self._begin)
            self._begin = self._growing.planned
            self._stretch = self._follow(paths)
        return self._stretch.control(frame - self._begin * self.controls_per_frame, world)

    def _follow(
        self, paths: tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]] | None
    ) -> KeystrokeController:
        """Plan a stretch; what controls it, and what comes just after it."""
        stroke = self._tracker.config.stroke
        takes = stroke.longest + stroke.settle
        # Strokes that begin in the stretch are planned to their end.
        ahead = math.ceil(max(self._config.ahead, takes) * FRAME_RATE)
        stop = min(self._begin + max(1, round(self._length * FRAME_RATE)), self._frames)
        self._length = min(2 * self._length, self._config.longest)
        self._growing.extend(stop, ahead)
        plan, here = self._growing.plan, slice(self._begin, stop + ahead)
        began, ends = self._begin * FRAME_SECONDS, (stop + ahead) * FRAME_SECONDS
        strikes = _strikes(plan)
        chosen = np.flatnonzero(
            (strikes.release + stroke.rise > began) & (strikes.onset - takes < ends)
        )
        stretch = replace(
            plan,
            fingertips=plan.fingertips[here],
            finger_key=plan.finger_key[here],
            strikes=strikes.some_since(chosen, began),
            joints=None,  # of no use here: strikes have their own path
        )
        # A finger that is on its key stays where it struck it.
        held = strikes.onset[chosen] < began
        begun = paths and Continuation(
            *paths,
            plan.fingertips[self._begin - 1],
            plan.finger_key[self._begin - 1] >= 0,
            np.where(held, self._x[chosen], np.nan),
        )
        controller = self._tracker.start(stretch, begun or None)
        self._x[chosen] = controller.x
        return controller


def _strikes(plan: FingertipPlan) -> Strikes:
    assert plan.strikes is not None  # the plans of `ZeroShotPlanner` have them
    return plan.strikes
