"""Predictive sampling: variations of a controller's controls are tried before they are played.

The base controller is followed a little way ahead in a copy of the world. Where something would go
wrong, variations of its controls are rolled out side by side and the best is taken (Howell et al.,
"Predictive sampling: real-time behaviour synthesis with MuJoCo", 2022), with the base controls as
the first guess. Where nothing goes wrong it costs one rollout, which is kept as long as it comes
true.

With perturbed copies of the world, the same is done in each of them, where the controls that are
played are replayed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_SECONDS
from pianomime.plan import FingertipPlan
from pianomime.track.controller import Controller, controls_per_frame
from pianomime.track.heard import Frame, strikes_in
from pianomime.track.sampling.cost import Cost
from pianomime.track.sampling.key_cost import KeyCost
from pianomime.track.sampling.look_ahead import LookAhead, Step
from pianomime.track.sampling.perturbed_copies import PerturbedCopy
from pianomime.track.sampling.rollouts import Rollouts, Start, keys_of
from pianomime.track.sampling.variations import VariationConfig, Variations
from pianomime.track.tracker import Tracker
from pianomime.validation import within
from pianomime.world import World
from pianomime.world.layout import LAYOUT
from pianomime.world_names import PAPER

SOLID_APART = 0.04
"""[m] Distance from which on hands that do not pass through each other do not touch."""


@dataclass(frozen=True)
class PredictiveSamplingConfig(VariationConfig):
    """The sampling budget, and the distribution of the variations."""

    rounds: int = 2
    """Rounds of variations, each around the best so far: rounds gain more than variations do."""
    commit: int = 4
    """Frames that are played before looking ahead again."""
    ahead: int = 8
    """Frames that are looked ahead."""
    apart: float = 0.0
    """Distance between the fingers of both hands along the keyboard from which on a hand that alone
    is varied is simulated alone [m]; 0 for however near they are, which counts as `SOLID_APART`
    in worlds in which they do not pass through each other."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("rounds", "commit", "ahead"):
            within(name, getattr(self, name), 1)

    @classmethod
    def of_effort(cls, effort: int) -> PredictiveSamplingConfig:
        """The budgets of efforts 1 to 3: each is several times the one before."""
        return {
            1: cls(),
            2: cls(rounds=6),
            3: cls(variations=32, rounds=12),
        }[effort]


class PredictiveSamplingTracker:
    """Follows plans as another tracker does, but for the variations that hit more keys.

    Args:
        tracker: whose controls to improve; its controllers must be replayable.
        config: the sampling budget.
        goal: (T, 88) bool, the keys that should be down; those that the plan presses if None.
        threads: how many variations step at the same time; 0 for one on each core.
        world: name of the world in which variations are tried.
    """

    def __init__(
        self,
        tracker: Tracker,
        config: PredictiveSamplingConfig | None = None,
        goal: NDArray[np.bool_] | None = None,
        threads: int = 0,
        world: str = PAPER,
    ) -> None:
        self.config = config or PredictiveSamplingConfig()
        self._tracker, self._goal, self._threads = tracker, goal, threads
        self._world = world

    def start(self, plan: FingertipPlan) -> PredictiveSamplingController:
        """A controller; for the same plan it draws the same variations.

        Raises:
            InputError: the other tracker's controller is not replayable, has no plan, or gives
                several controls a frame; or the goal is shorter than the plan.
        """
        goal = plan.keys() if self._goal is None else self._goal
        if len(goal) < len(plan):
            raise InputError(f"a goal of {len(goal)} frames is too short: the plan has {len(plan)}")
        base = self._tracker.start(plan)
        if base.replayable and controls_per_frame(base) > 1:
            raise InputError(
                f"predictive sampling needs one control a frame, but {type(base).__name__} gives "
                f"{controls_per_frame(base)}: such controllers are for note sampling"
            )
        cost = KeyCost(goal)
        return PredictiveSamplingController(
            base, self.config, cost, goal, self._threads, self._world
        )


class PredictiveSamplingController:
    """Improves a replayable controller.

    It commits to a few frames at a time and draws random numbers, so it is not replayable itself.

    Attributes:
        plan: what is followed.
        copies: of the world, perturbed. They have followed what is to be played as far as it was
            chosen.

    Args:
        base: the controller to improve.
        config: the sampling budget.
        cost: of what is heard; it remembers what was.
        goal: (T, 88) bool, the keys that should be down.
        threads: how many variations step at the same time; 0 for one on each core.
        world: name of the world in which variations are tried.
        trigger: cost of the next frames above which variations are tried even where nothing goes
            wrong in them.
        copies: in which controls have to go well, too, when they are replayed there.

    Raises:
        InputError: `base` is not replayable, or has no plan.
    """

    replayable = False

    def __init__(
        self,
        base: Controller,
        config: PredictiveSamplingConfig,
        cost: Cost,
        goal: NDArray[np.bool_],
        threads: int = 0,
        world: str = PAPER,
        trigger: float = math.inf,
        copies: Sequence[PerturbedCopy] = (),
    ) -> None:
        if not base.replayable:
            raise InputError(
                f"predictive sampling needs a replayable controller, which {type(base).__name__} "
                "is not: it cannot be asked ahead on copies of the world"
            )
        if base.plan is None:
            raise InputError("predictive sampling needs a plan, to know which fingers to vary")
        self.config, self.plan, self.copies = config, base.plan, list(copies)
        self._cost, self._trigger = cost, trigger
        self._parts = controls_per_frame(base)
        # Solid hands that are near each other are never simulated alone.
        self._apart = config.apart or (0.0 if world == PAPER else SOLID_APART)
        self._look = LookAhead(base)
        self._variations = Variations(self.plan, config)
        self._rollouts = Rollouts(cost, goal, config.variations, threads, world)
        self._chosen: list[NDArray[np.float64]] = []

    @property
    def controls_per_frame(self) -> int:
        """Number of controls that follow one another in a frame."""
        return self._parts

    @property
    def steps(self) -> int:
        """Number of frames that were simulated to look ahead so far."""
        return self._look.steps + self._rollouts.steps + sum(copy.steps for copy in self.copies)

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
        parts = self._parts
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
        known = self._look.frames(first, frames, world)
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
            self._look.forget()
            ctrl = self._vary(known, starts, self._variations.probabilities(first, wrong))
        else:
            self._look.played(commit)
        chosen = list(ctrl[:commit])
        for copy in self.copies:
            copy.follow(first, chosen)
        return chosen

    def _wrong(self, cost: Cost, first: int, heard: Sequence[Frame]) -> list[tuple[int, int]]:
        """What goes wrong in a world, as of `Cost.of`; nothing where it is not to be varied."""
        config, frames = self.config, len(heard)
        value, soon = cost.of(first, heard, min(config.commit + 2, frames))
        _, wrong = cost.of(first, heard, frames)
        # Where many keys are a little wrong, but nothing else, there is no finger to blame.
        return wrong if soon or value >= self._trigger else []

    def _vary(
        self, known: list[Step], starts: list[Start], probability: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(H, S, 46) The best variation of controls that were looked ahead.

        Args:
            known: what was looked ahead.
            starts: whence they are rolled out in the world and in its copies, with both hands.
            probability: (46,) that each actuator is varied.
        """
        rollouts = [self._rollouts, *(copy.rollouts for copy in self.copies)]
        varied = [hand for hand, range_ in enumerate(LAYOUT.actuators) if probability[range_].any()]
        each = list(zip(rollouts, starts, strict=True))
        if len(varied) == 1 and not self._apart:
            base = np.array([step.ctrl for step in known])
            starts = [world.start_beside(start, varied[0], base) for world, start in each]
        elif len(varied) == 1:
            hands = np.array([step.hands for step in known])
            keys = keys_of(varied[0], hands, self._apart)
            if keys is not None:
                starts = [world.start_alone(start, varied[0], keys) for world, start in each]
        start, copies = starts[0], list(zip(rollouts, starts, strict=True))[1:]
        best = self._rollouts.best(start, np.array([[step.ctrl for step in known]]), copies=copies)
        for _ in range(self.config.rounds):
            drawn = self._variations.draw(len(known), probability, self._parts)
            # The first is the best so far.
            tries = best.ctrl + drawn[1:].reshape(-1, *best.ctrl.shape)
            best = self._rollouts.best(start, tries, best, copies)
        return best.ctrl
