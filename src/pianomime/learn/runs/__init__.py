"""Runs: folders of trainings that can be resumed, and the training loop of networks."""
