"""Trackers: from a FingertipPlan to controls."""

from pianomime.track.batch import BatchTracker
from pianomime.track.dynamic import DynamicConfig, DynamicTracker
from pianomime.track.ik import IkConfig, IkTracker
from pianomime.track.rollout import RolloutConfig, RolloutTracker
from pianomime.track.tracker import PedalTracker, Tracker

__all__ = [
    "BatchTracker",
    "DynamicConfig",
    "DynamicTracker",
    "IkConfig",
    "IkTracker",
    "PedalTracker",
    "RolloutConfig",
    "RolloutTracker",
    "Tracker",
]
