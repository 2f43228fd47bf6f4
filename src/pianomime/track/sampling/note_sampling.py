"""Note sampling: predictive sampling that listens to notes.

What counts is what an ear minds (`note_cost`): a strike that nobody wanted costs more than a missed
inner note, and strikes have their times and touch.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from pianomime.plan import FingertipPlan
from pianomime.track.rehearsal import KeystrokeStarter
from pianomime.track.sampling.note_cost import NoteCost, NoteCostConfig
from pianomime.track.sampling.perturbed_copies import COPIES, PerturbedCopy
from pianomime.track.sampling.predictive_sampling import (
    SOLID_APART,
    PredictiveSamplingConfig,
    PredictiveSamplingController,
)
from pianomime.validation import within
from pianomime.world.touch import TOUCHES


@dataclass(frozen=True)
class NoteSamplingConfig(PredictiveSamplingConfig):
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
    apart: float = SOLID_APART
    """Distance between the fingers of both hands along the keyboard from which on a hand that alone
    is varied is simulated alone [m]; 0 as in `PredictiveSamplingConfig`."""
    trigger: float = 0.6
    """Cost of the next frames above which variations are tried; also where a note is wrong."""
    copies: int = 0
    """Perturbed copies of the world, up to 3, in which controls have to go well, too, when they are
    replayed there. Each costs about as much again."""
    cost: NoteCostConfig = field(default_factory=NoteCostConfig)
    """What an ear minds."""

    def __post_init__(self) -> None:
        super().__post_init__()
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

    def start(self, plan: FingertipPlan) -> PredictiveSamplingController:
        """A controller; for the same plan it draws the same variations."""
        base, config, goal = self._tracker.start(plan), self.config, plan.keys()
        stroke = base.config.stroke
        wanted = replace(base.strikes, velocity=stroke.velocities(base.strikes))

        def cost() -> NoteCost:
            """Each world has its own, because other notes may sound in it."""
            return NoteCost(wanted, goal, TOUCHES[stroke.touch], config.cost)

        copies = [
            PerturbedCopy(each, base.world, cost(), goal, config.variations, self._threads)
            for each in COPIES[: config.copies]
        ]
        return PredictiveSamplingController(
            base, config, cost(), goal, self._threads, base.world, config.trigger, copies
        )
