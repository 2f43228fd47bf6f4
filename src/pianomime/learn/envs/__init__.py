"""Environments of one song, for Gymnasium and Stable-Baselines3."""
