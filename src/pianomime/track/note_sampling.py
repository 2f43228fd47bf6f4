"""Note sampling: predictive sampling that listens to notes.

As in `predictive_sampling`, the base controller is followed a little way ahead in a copy of the
world, and where something goes wrong, variations of its controls are rolled out side by side. What
counts is what an ear minds (`note_cost`): a strike that nobody wanted costs more than a missed
inner note, and strikes have their times and touch. What was looked ahead is kept while nothing is
wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS
from pianomime.plan import FingertipPlan
from pianomime.track.keystroke import KeystrokeController
from pianomime.track.note_cost import Frame, NoteCost, NoteCostConfig, Strike, strikes_in
from pianomime.track.rehearsal import KeystrokeStarter
from pianomime.track.variations import VariationConfig, Variations
from pianomime.validation import within
from pianomime.world import World, WorldBatch
from pianomime.world.touch import TOUCHES

_SHORT = 0.01
"""Cost of a key's way to where it should be: keys that are nearly right are better."""
_BROKEN = 100.0
"""Cost of physics that breaks."""


@dataclass(frozen=True)
class NoteSamplingConfig(VariationConfig):
    """The sampling budget, the distribution of the variations, and the costs."""

    joint: float = 0.15
    """Standard deviation of variations of the fingers' actuators [rad]."""
    wrist: float = 0.05
    """Standard deviation of variations of the wrists' actuators [rad]."""
    slide: float = 0.005
    """Standard deviation of variations of the forearms' slides [m]."""
    rounds: int = 2
    """Rounds of variations, each around the best so far."""
    commit: int = 3
    """Frames that are played before looking ahead again."""
    ahead: int = 6
    """Frames that are looked ahead."""
    trigger: float = 0.6
    """Cost of the next frames above which variations are tried; also where a note is wrong."""
    cost: NoteCostConfig = field(default_factory=NoteCostConfig)
    """What an ear minds."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("rounds", "commit", "ahead"):
            within(name, getattr(self, name), 1)

    @classmethod
    def of_effort(cls, effort: int) -> NoteSamplingConfig:
        """The budgets of efforts 1 to 3: each is several times the one before."""
        return {
            1: cls(),
            2: cls(rounds=6),
            3: cls(variations=32, rounds=12),
        }[effort]


class NoteSamplingTracker:
    """Follows plans as another tracker does, but for variations that sound better.

    Args:
        tracker: whose controls to improve.
        config: the sampling budget and costs.
        threads: how many variations step at the same time; 0 for one on each core.
    """

    def __init__(
        self,
        tracker: KeystrokeStarter,
        config: NoteSamplingConfig | None = None,
        threads: int = 0,
    ) -> None:
        self.config = config or NoteSamplingConfig()
        self._tracker, self._threads = tracker, threads

    def start(self, plan: FingertipPlan) -> NoteSamplingController:
        """A controller; for the same plan it draws the same variations."""
        return NoteSamplingController(self._tracker.start(plan), self.config, self._threads)


class _Step(NamedTuple):
    """A frame that was looked ahead: its controls (S, 46), and what was heard."""

    ctrl: NDArray[np.float64]
    frame: Frame


class NoteSamplingController:
    """Improves a keystroke controller.

    It commits to a few frames at a time and draws random numbers, so it is not replayable.

    Attributes:
        plan: what is followed.
        steps: frames that were simulated to look ahead so far.

    Args:
        base: the controller to improve.
        config: the sampling budget and costs.
        threads: how many variations step at the same time; 0 for one on each core.
    """

    replayable = False

    def __init__(
        self, base: KeystrokeController, config: NoteSamplingConfig, threads: int = 0
    ) -> None:
        self.config, self.plan, self.steps = config, base.plan, 0
        self._base = base
        self._goal = base.plan.keys()
        stroke = base.config.stroke
        wanted = replace(base.strikes, velocity=stroke.velocities(base.strikes))
        self._cost = NoteCost(wanted, self._goal, TOUCHES[stroke.touch], config.cost)
        self._variations = Variations(base.plan, config)
        self._batch = WorldBatch(config.variations, threads, quiet=True, model=base.world)
        self._chosen: list[_Step] = []
        self._known: list[_Step] = []
        self._ahead: World | None = None

    @property
    def controls_per_frame(self) -> int:
        """Number of controls that follow one another in a frame."""
        return self._base.controls_per_frame

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) the control found.

        Args:
            frame: number of the control, of which a frame has `controls_per_frame`.
            world: as it is before it.
        """
        number, part = divmod(frame, self.controls_per_frame)
        if part == 0:
            if number:
                self._cost.heard(self._chosen.pop(0).frame.strikes)
            if not self._chosen:
                self._chosen = self._choose(number, world)
        control: NDArray[np.float64] = self._chosen[0].ctrl[part]
        return control

    def _choose(self, first: int, world: World) -> list[_Step]:
        """The next frames to be played."""
        config = self.config
        frames = min(config.ahead, len(self.plan) - first)
        commit = min(config.commit, frames)
        known = self._look_ahead(first, frames, world)
        heard = [step.frame for step in known]
        cost, wrong = self._cost.of(first, heard, min(commit + 2, frames))
        if not wrong and cost < config.trigger:
            self._known = known[commit:]
            return known[:commit]
        self._ahead = None
        _, wrong = self._cost.of(first, heard, frames)
        probability = self._variations.probabilities(first, wrong)
        ctrl = np.array([step.ctrl for step in known])
        for _ in range(config.rounds):
            drawn = self._variations.draw(frames, probability, self.controls_per_frame)
            tries = ctrl + drawn.reshape(-1, *ctrl.shape)
            tries[0] = ctrl
            costs, played = self._roll_out(first, world, tries)
            best = int(np.argmin(costs))
            ctrl, heard = tries[best], played[best]
        return [_Step(*step) for step in zip(ctrl[:commit], heard[:commit], strict=True)]

    def _look_ahead(self, first: int, frames: int, world: World) -> list[_Step]:
        """What the base controller does in the next frames."""
        if self._ahead is None:
            self._ahead, self._known = world.copy(quiet=True), []
        known, parts = list(self._known), self.controls_per_frame
        for number in range(first + len(known), first + frames):
            ctrl, strikes = [], []
            for part in range(parts):
                ctrl.append(self._base.control(number * parts + part, self._ahead))
                self._ahead.step(ctrl[-1], parts=parts)
                begin = (number + part / parts) * FRAME_SECONDS
                strikes += strikes_in(self._ahead.key_events, begin)
            known.append(_Step(np.array(ctrl), Frame(strikes, self._ahead.pressed)))
            self.steps += 1
        return known

    def _roll_out(
        self, first: int, world: World, tries: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], list[list[Frame]]]:
        """(B,) Costs of controls (B, H, S, 46), and what is heard with each."""
        batch, frames = self._batch, tries.shape[1]
        batch.set_state(world.state())
        batch.sounding[:] = world.sounding
        played: list[list[Frame]] = [[] for _ in tries]
        cost = np.zeros(len(tries))
        for step in range(frames):
            batch.step(tries[:, step])
            down, events = batch.pressed, batch.key_events
            heard: list[list[Strike]] = [[] for _ in tries]
            begin = (first + step) * FRAME_SECONDS
            for index in np.unique(events.world):
                heard[index] = strikes_in(events, begin, index)
            for index, frame in enumerate(played):
                frame.append(Frame(heard[index], down[index]))
            cost += _SHORT * np.abs(batch.key_state - self._goal[first + step]).sum(axis=1)
        self.steps += len(tries) * frames
        cost += [self._cost.of(first, frame, frames)[0] for frame in played]
        return cost + _BROKEN * batch.blow_ups, played
