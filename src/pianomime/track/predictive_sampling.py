"""Predictive sampling: variations of a controller's controls are tried before they are played.

The base controller is followed a little way ahead in a copy of the world. Where keys would go
wrong, variations of its controls are rolled out side by side and the best is taken (Howell et al.,
"Predictive sampling: real-time behaviour synthesis with MuJoCo", 2022), with the base controls as
the first guess. Where nothing goes wrong it costs one rollout.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.plan import FingertipPlan
from pianomime.track.controller import Controller, controls_per_frame
from pianomime.track.tracker import Tracker
from pianomime.track.variations import VariationConfig, Variations
from pianomime.validation import within
from pianomime.world import World, WorldBatch
from pianomime.world_names import PAPER


@dataclass(frozen=True)
class PredictiveSamplingConfig(VariationConfig):
    """The sampling budget, and the distribution of the variations."""

    rounds: int = 2
    """Rounds of variations, each around the best so far: rounds gain more than variations do."""
    commit: int = 4
    """Frames that are played before looking ahead again."""
    ahead: int = 8
    """Frames that are looked ahead."""

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
                several controls a frame.
        """
        goal = plan.keys() if self._goal is None else self._goal
        return PredictiveSamplingController(
            self._tracker.start(plan), self.config, goal, self._threads, self._world
        )


class PredictiveSamplingController:
    """Improves a replayable controller.

    It commits to a few frames at a time and draws random numbers, so it is not replayable itself.

    Attributes:
        steps: control steps that were simulated to look ahead so far.

    Args:
        base: the controller to improve.
        config: the sampling budget.
        goal: (T, 88) bool, the keys that should be down.
        threads: how many variations step at the same time; 0 for one on each core.
        world: name of the world in which variations are tried.

    Raises:
        InputError: `base` is not replayable, has no plan, or gives several controls a frame.
    """

    replayable = False

    def __init__(
        self,
        base: Controller,
        config: PredictiveSamplingConfig,
        goal: NDArray[np.bool_],
        threads: int = 0,
        world: str = PAPER,
    ) -> None:
        if not base.replayable:
            raise InputError(
                f"predictive sampling needs a replayable controller, which {type(base).__name__} "
                "is not: it cannot be asked ahead on copies of the world"
            )
        if base.plan is None:
            raise InputError("predictive sampling needs a plan, to know which fingers to vary")
        if controls_per_frame(base) > 1:
            raise InputError(
                f"predictive sampling needs one control a frame, but {type(base).__name__} gives "
                f"{controls_per_frame(base)}: such controllers are for note sampling"
            )
        self.config = config
        self.plan = base.plan
        self.steps = 0
        self._base, self._goal = base, goal
        self._batch = WorldBatch(config.variations, threads, quiet=True, model=world)
        self._variations = Variations(self.plan, config)
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
            ctrl[step] = self._base.control(frame + step, ahead)
            ahead.step(ctrl[step])
            pressed[step] = ahead.pressed
        self.steps += len(goal)
        wrong = pressed != goal
        if not wrong[: self.config.commit + 2].any():
            return ctrl
        state = world.state()
        probability = self._variations.probabilities(frame, np.argwhere(wrong))
        for _ in range(self.config.rounds):
            tries = ctrl + self._variations.draw(len(goal), probability)
            tries[0] = ctrl
            cost = self._cost(state, tries, goal)
            ctrl = tries[int(np.argmin(cost))]
        return ctrl

    def _cost(
        self,
        state: NDArray[np.float64],
        ctrl: NDArray[np.float64],
        goal: NDArray[np.bool_],
    ) -> NDArray[np.float64]:
        """(B,) cost of each of the controls (B, H, 46) from a state on."""
        self._batch.set_state(state)
        self.steps += len(ctrl) * len(goal)
        cost = np.zeros(len(ctrl))
        for step in range(len(goal)):
            self._batch.step(ctrl[:, step])
            wrong = self._batch.pressed != goal[step]
            # Keys that are nearly right are better than keys that are not.
            short = np.abs(self._batch.key_state - goal[step])
            cost += wrong.sum(axis=1) + 0.1 * short.sum(axis=1)
        return cost + 100.0 * self._batch.blow_ups
