"""Predictive sampling: variations of controls are rolled out, and the best are played."""
