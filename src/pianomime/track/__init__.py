"""Trackers: from a FingertipPlan to a Controller."""

from pianomime.track.controller import (
    BatchController,
    Controller,
    FineController,
    PedalController,
    controls_per_frame,
)
from pianomime.track.dynamic import DynamicConfig, DynamicTracker
from pianomime.track.ik import IkConfig, IkTracker
from pianomime.track.keystroke import KeystrokeConfig, KeystrokeTracker
from pianomime.track.rehearsal import RehearsalConfig, RehearsedTracker
from pianomime.track.replay import ReplayTracker
from pianomime.track.sampling.note_sampling import NoteSamplingConfig, NoteSamplingTracker
from pianomime.track.sampling.predictive_sampling import (
    PredictiveSamplingConfig,
    PredictiveSamplingTracker,
)
from pianomime.track.tracker import BatchTracker, Tracker

__all__ = [
    "BatchController",
    "BatchTracker",
    "Controller",
    "DynamicConfig",
    "DynamicTracker",
    "FineController",
    "IkConfig",
    "IkTracker",
    "KeystrokeConfig",
    "KeystrokeTracker",
    "NoteSamplingConfig",
    "NoteSamplingTracker",
    "PedalController",
    "PredictiveSamplingConfig",
    "PredictiveSamplingTracker",
    "RehearsalConfig",
    "RehearsedTracker",
    "ReplayTracker",
    "Tracker",
    "controls_per_frame",
]
