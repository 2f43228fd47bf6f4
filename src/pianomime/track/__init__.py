"""Trackers: from a FingertipPlan to controls."""

from pianomime.track.batch import BatchTracker
from pianomime.track.dynamic import DynamicConfig, DynamicTracker
from pianomime.track.ik import IkConfig, IkTracker
from pianomime.track.predictive_sampling import PredictiveSamplingConfig, PredictiveSamplingTracker
from pianomime.track.tracker import PedalTracker, Tracker

__all__ = [
    "BatchTracker",
    "DynamicConfig",
    "DynamicTracker",
    "IkConfig",
    "IkTracker",
    "PedalTracker",
    "PredictiveSamplingConfig",
    "PredictiveSamplingTracker",
    "Tracker",
]
