"""Planners: from a Score to a FingertipPlan, and demonstrations, which hold both.

A new planner is a class with a method `plan`, in a file of its own; see `Planner`.
"""

from pianomime.plan.demonstration import Demonstration, DemonstrationPlanner
from pianomime.plan.fingering import Fingering, find_fingering
from pianomime.plan.fingering_cost import FingeringConfig
from pianomime.plan.fingertip_plan import FINGERS, LEFT, POINTS, RIGHT, FingertipPlan
from pianomime.plan.hand_path import HandPathConfig, hand_paths, make_feasible
from pianomime.plan.planner import Planner
from pianomime.plan.zero_shot import ZeroShotConfig, ZeroShotPlanner

__all__ = [
    "FINGERS",
    "LEFT",
    "POINTS",
    "RIGHT",
    "Demonstration",
    "DemonstrationPlanner",
    "Fingering",
    "FingeringConfig",
    "FingertipPlan",
    "HandPathConfig",
    "Planner",
    "ZeroShotConfig",
    "ZeroShotPlanner",
    "find_fingering",
    "hand_paths",
    "make_feasible",
]
