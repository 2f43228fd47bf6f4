"""Trackers: from a FingertipPlan to controls."""

from pianomime.track.ik import IkConfig, IkTracker
from pianomime.track.tracker import Tracker

__all__ = ["IkConfig", "IkTracker", "Tracker"]
