"""Planners: from a Score to a FingertipPlan."""

from pianomime.plan.fingertip_plan import FINGERS, LEFT, POINTS, RIGHT, FingertipPlan
from pianomime.plan.planner import Planner
from pianomime.plan.zero_shot import ZeroShotConfig, ZeroShotPlanner

__all__ = [
    "FINGERS",
    "LEFT",
    "POINTS",
    "RIGHT",
    "FingertipPlan",
    "Planner",
    "ZeroShotConfig",
    "ZeroShotPlanner",
]
