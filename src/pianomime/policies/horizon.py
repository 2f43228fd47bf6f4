"""Horizons of the learned policies (paper, appendix F). Cheap to import: no numpy."""

CHUNK = 4
"""Frames of actions that a policy predicts at once, and frames that low levels see ahead."""
GOAL_HORIZON = 10
"""Frames of goals that high levels see: the present one and those that follow."""
MOST_DIFFUSION_STEPS = 10_000
"""Steps that a diffusion may have in training; a hundred are usual."""
