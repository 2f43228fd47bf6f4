"""Experts of one song: residual PPO and trajectory search."""
