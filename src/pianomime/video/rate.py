"""How many frames there are to a second."""

RATE = 20.0
"""Frames a second of hands, key light and plans, whatever the video's own rate."""
