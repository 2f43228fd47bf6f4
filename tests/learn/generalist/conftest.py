"""Made-up clips, small enough to learn by heart in seconds."""

from __future__ import annotations

import numpy as np
import pytest

from pianomime.generalist.features import rest_tips
from pianomime.learn.generalist.clips import Clips


@pytest.fixture
def clips() -> Clips:
    """Three clips of 30, 7 and 20 frames, the first two of one song; every frame is another."""
    draw = np.random.default_rng(0)
    frames = 57
    goal = np.zeros((frames, 88), bool)
    goal[np.arange(frames), 20 + np.arange(frames) % 40] = True
    return Clips(
        {
            "goal": goal,
            "fingertips": (rest_tips() + draw.normal(0, 0.02, (frames, 2, 6, 3))).astype("f4"),
            "joints": draw.normal(0, 0.1, (frames, 54)).astype("f4"),
            "velocities": draw.normal(0, 1, (frames, 54)).astype("f4"),
            "keys": np.where(goal, 0.5, 0.0).astype("f4"),
            "prior": draw.normal(0, 0.1, (frames, 46)).astype("f4"),
            "action": draw.normal(0, 0.1, (frames, 46)).astype("f4"),
        },
        np.array([30, 37, 57]),
        np.array([4, 4, 9]),
        ["a", "b", "c"],
    )
