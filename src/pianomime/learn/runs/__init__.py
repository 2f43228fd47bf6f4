"""Runs: folders of trainings that can be resumed, and the processes that work in them."""
