"""The players of learned policies alone, which need no planner."""

from __future__ import annotations

from dataclasses import dataclass

from pianomime.music import Score
from pianomime.plan.hand_path import make_feasible
from pianomime.players.player import Player
from pianomime.policies.finger_assignment import flat_plan
from pianomime.policies.generalist import OneStageController, TwoStageController
from pianomime.policies.policy import Policy
from pianomime.policies.policy_tracker import PolicyController, PolicyTracker
from pianomime.policies.predicted_plan import CANDIDATES, predicted_plan
from pianomime.policies.three_stage.controller import Stages, ThreeStageController
from pianomime.short_repr import short_repr
from pianomime.track import Controller
from pianomime.validation import whole_numbers, within
from pianomime.world_names import PAPER

MOST_CANDIDATES = 16
"""Each takes 21 MB of memory for an hour of music."""


@dataclass(frozen=True)
class PredictionConfig:
    """How fingertips are predicted, and followed."""

    feasible: bool = True
    """Predict the whole song, and move fingertips to where the robot's hands can be, see
    `make_feasible`; otherwise they are predicted while it is played, and followed as they are."""
    candidates: int = CANDIDATES
    """Predictions of the whole song that are made side by side, of which those whose hands fit
    their keys best go on; of no effect where they are not made feasible."""

    def __post_init__(self) -> None:
        whole_numbers(self, "planner")
        within("planner.candidates", self.candidates, 1, MOST_CANDIDATES)


@dataclass(frozen=True)
class GeneralistPlayer(Player):
    """Plays any score with learned policies; controls are decided in every frame anew.

    Attributes:
        name: what reports call it.
        low: the tracker of the low-level policy, or of one that goes from goals to controls.
        high: the fingertip policy; None for a policy of one stage.
        seed: of the fingertip policy's sampling.
        effort: how many steps a diffusion is sampled in, 0 to 3.
        prediction: how the fingertips of a policy of two stages are followed.
        world: see `Player`; the policies were trained in the paper's.
    """

    name: str
    low: PolicyTracker
    high: Policy | None = None
    seed: int = 0
    effort: int = 0
    prediction: PredictionConfig = PredictionConfig()
    world: str = PAPER

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), f"effort {self.effort}")

    def start(self, score: Score) -> Controller:
        """Predict the fingertips of the whole score, where there are two stages."""
        if self.high is None:
            return OneStageController(score, self.low)
        if not self.prediction.feasible:
            return TwoStageController(score, self.high, self.low, self.seed)
        plan = predicted_plan(score, self.high, self.seed, self.prediction.candidates)
        plan = flat_plan(make_feasible(plan))
        return PolicyController(plan, self.low, score.roll())


@dataclass(frozen=True)
class ThreeStagePlayer(Player):
    """Plays any score with policies that say fingers, fingertips and controls, closed loop.

    Attributes:
        name: what reports call it.
        stages: the policies.
        effort: of no effect: nothing is sampled, nothing searched for.
        world: see `Player`; the policies were trained in the paper's.
    """

    name: str
    stages: Stages
    effort: int = 0
    world: str = PAPER

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name))

    def start(self, score: Score) -> Controller:
        """Everything happens frame by frame."""
        return ThreeStageController(score, self.stages)
