"""Note sampling: predictive sampling that listens to notes.

As in `predictive_sampling`, the base controller is followed a little way ahead in a copy of the
world, and where something goes wrong, variations of its controls are rolled out side by side. What
counts is what an ear minds (`note_cost`): a strike that nobody wanted costs more than a missed
inner note, and strikes have their times and touch. What was looked ahead is kept while nothing is
wrong.

With perturbed copies of the world, the same is done in each of them, where the controls that are
played are replayed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS
from pianomime.plan import FingertipPlan
from pianomime.track.keystroke import KeystrokeController
from pianomime.track.note_cost import Frame, NoteCost, NoteCostConfig, strikes_in
from pianomime.track.note_rollouts import Rollouts, Start, keys_of
from pianomime.track.perturbed_copies import COPIES, PerturbedCopy
from pianomime.track.rehearsal import KeystrokeStarter
from pianomime.track.variations import VariationConfig, Variations
from pianomime.validation import within
from pianomime.world import World
from pianomime.world.layout import LAYOUT
from pianomime.world.touch import TOUCHES


@dataclass(frozen=True)
class NoteSamplingConfig(VariationConfig):
    """The sampling budget, the distribution of the variations, and the costs."""

    joint: float = 0.15
    """Standard deviation of variations of the fingers' actuators [rad]."""
    wrist: float = 0.05
    """Standard deviation of variations of the wrists' actuators [rad]."""
    slide: float = 0.005
    """Standard deviation of variations of the forearms' slides [m]."""
    rounds: int = 3
    """Rounds of variations, each around the best so far."""
    commit: int = 3
    """Frames that are played before looking ahead again."""
    ahead: int = 6
    """Frames that are looked ahead."""
    trigger: float = 0.6
    """Cost of the next frames above which variations are tried; also where a note is wrong."""
    apart: float = 0.04
    """Distance between the fingers of both hands along the keyboard from which on a hand that alone
    is varied is simulated alone [m]."""
    copies: int = 0
    """Perturbed copies of the world, up to 3, in which controls have to go well, too, when they are
    replayed there. Each costs about as much again."""
    cost: NoteCostConfig = field(default_factory=NoteCostConfig)
    """What an ear minds."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("rounds", "commit", "ahead"):
            within(name, getattr(self, name), 1)
        within("copies", self.copies, 0, len(COPIES))

    @classmethod
    def of_effort(cls, effort: int) -> NoteSamplingConfig:
        """The budgets of efforts 1 to 3: each is several times the one before."""
        return {
            1: cls(),
            2: cls(rounds=9),
            3: cls(variations=32, rounds=18),
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
    """A frame that was looked ahead.

    Attributes:
        ctrl: (S, 46) its controls.
        frame: what was heard.
        hands: (54,) joint positions of both hands at its end [rad, m].
    """

    ctrl: NDArray[np.float64]
    frame: Frame
    hands: NDArray[np.float64]


class NoteSamplingController:
    """Improves a keystroke controller.

    It commits to a few frames at a time and draws random numbers, so it is not replayable.

    Attributes:
        plan: what is followed.
        copies: of the world, perturbed. They have followed what is to be played as far as it was
            chosen.

    Args:
        base: the controller to improve.
        config: the sampling budget and costs.
        threads: how many variations step at the same time; 0 for one on each core.
    """

    replayable = False

    def __init__(
        self, base: KeystrokeController, config: NoteSamplingConfig, threads: int = 0
    ) -> None:
        self.config, self.plan = config, base.plan
        self._base, self._followed = base, 0
        goal = base.plan.keys()
        stroke = base.config.stroke
        wanted = replace(base.strikes, velocity=stroke.velocities(base.strikes))
        touch = TOUCHES[stroke.touch]
        self._cost = NoteCost(wanted, goal, touch, config.cost)
        self._variations = Variations(base.plan, config)
        self._rollouts = Rollouts(self._cost, goal, config.variations, threads, base.world)
        self.copies = [
            PerturbedCopy(
                each,
                base.world,
                NoteCost(wanted, goal, touch, config.cost),
                goal,
                config.variations,
                threads,
            )
            for each in COPIES[: config.copies]
        ]
        self._chosen: list[NDArray[np.float64]] = []
        self._known: list[_Step] = []
        self._ahead: World | None = None

    @property
    def controls_per_frame(self) -> int:
        """Number of controls that follow one another in a frame."""
        return self._base.controls_per_frame

    @property
    def steps(self) -> int:
        """Number of frames that were simulated to look ahead so far."""
        return self._followed + self._rollouts.steps + sum(copy.steps for copy in self.copies)

    @property
    def steps_alone(self) -> int:
        """Of these, the number in which one hand alone was simulated."""
        return self._rollouts.alone + sum(copy.rollouts.alone for copy in self.copies)

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) the control found.

        Args:
            frame: number of the control, of which a frame has `controls_per_frame`.
            world: as it is before it.
        """
        parts = self.controls_per_frame
        number, part = divmod(frame, parts)
        self._cost.heard(strikes_in(world.key_events, (frame - 1) / parts * FRAME_SECONDS))
        if part == 0:
            self._chosen = self._chosen[1:] or self._choose(number, world)
        control: NDArray[np.float64] = self._chosen[0][part]
        return control

    def _choose(self, first: int, world: World) -> list[NDArray[np.float64]]:
        """The controls (S, 46) of each of the next frames to be played."""
        frames = min(self.config.ahead, len(self.plan) - first)
        commit = min(self.config.commit, frames)
        known = self._look_ahead(first, frames, world)
        ctrl = np.array([step.ctrl for step in known])
        starts = [self._rollouts.start(first, world, [step.frame for step in known])]
        starts += [copy.start(first, ctrl) for copy in self.copies]
        costs = [self._cost, *(copy.cost for copy in self.copies)]
        wrong = [
            each
            for cost, start in zip(costs, starts, strict=True)
            for each in self._wrong(cost, first, start.known)
        ]
        if wrong:
            self._ahead = None
            ctrl = self._vary(known, starts, self._variations.probabilities(first, wrong))
        else:
            self._known = known[commit:]
        chosen = list(ctrl[:commit])
        for copy in self.copies:
            copy.follow(first, chosen)
        return chosen

    def _wrong(self, cost: NoteCost, first: int, heard: Sequence[Frame]) -> list[tuple[int, int]]:
        """What goes wrong in a world, as of `NoteCost.of`; nothing where it is not to be varied."""
        config, frames = self.config, len(heard)
        value, soon = cost.of(first, heard, min(config.commit + 2, frames))
        _, wrong = cost.of(first, heard, frames)
        # Where many keys are a little wrong, but nothing else, there is no finger to blame.
        return wrong if soon or value >= config.trigger else []

    def _vary(
        self, known: list[_Step], starts: list[Start], probability: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(H, S, 46) The best variation of controls that were looked ahead.

        Args:
            known: what was looked ahead.
            starts: whence they are rolled out in the world and in its copies, with both hands.
            probability: (46,) that each actuator is varied.
        """
        rollouts = [self._rollouts, *(copy.rollouts for copy in self.copies)]
        varied = [hand for hand, range_ in enumerate(LAYOUT.actuators) if probability[range_].any()]
        if len(varied) == 1:
            hands = np.array([step.hands for step in known])
            keys = keys_of(varied[0], hands, self.config.apart)
            if keys is not None:
                starts = [
                    each.start_alone(start, varied[0], keys)
                    for each, start in zip(rollouts, starts, strict=True)
                ]
        start, copies = starts[0], list(zip(rollouts, starts, strict=True))[1:]
        best = self._rollouts.best(start, np.array([[step.ctrl for step in known]]), copies=copies)
        for _ in range(self.config.rounds):
            drawn = self._variations.draw(len(known), probability, self.controls_per_frame)
            # The first is the best so far.
            tries = best.ctrl + drawn[1:].reshape(-1, *best.ctrl.shape)
            best = self._rollouts.best(start, tries, best, copies)
        return best.ctrl

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
            known.append(
                _Step(np.array(ctrl), Frame(strikes, self._ahead.pressed), self._ahead.qpos_hands)
            )
            self._followed += 1
        return known
