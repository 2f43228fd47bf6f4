"""How far generalists look and plan ahead (paper, appendix F)."""

CHUNK = 4
"""Frames that are said at once."""
HIGH_GOALS = 10
"""Frames of goals that the high level sees."""
