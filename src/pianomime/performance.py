"""Performance: what happened when a player played a score.

Everything shown or measured is made from it, so a saved performance can be scored, heard and
rendered again without simulating.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.music import Score
from pianomime.plan import FingertipPlan



@dataclass(frozen=True, eq=False)
class Performance:
    """A played song, one row for each 0.05 s frame.

    Attributes:
        score: what was to be played.
        player: name of the player.
        plan: the fingertip plan, None for players that have none.
        ctrl: (T, 46) controls, RIGHT 23 then LEFT 23 [rad, m].
        qpos: (T, 142) all joint positions after each frame: 88 keys, RIGHT 27, LEFT 27 [rad, m].
        key_state: (T, 88) 0..1 of the way down, after each frame.
        pressed: (T, 88) bool, after each frame; to be compared with `score.roll()`.
        pedal: (T,) bool.
        blow_ups: frames in which the physics broke and the world had to be put back.
        plan_seconds, simulate_seconds: how long planning, and tracking with simulating, took.
    """

    score: Score
    player: str
    plan: FingertipPlan | None
    ctrl: NDArray[np.float64]
    qpos: NDArray[np.float64]
    key_state: NDArray[np.float64]
    pressed: NDArray[np.bool_]
    pedal: NDArray[np.bool_]
    blow_ups: NDArray[np.int64]
    plan_seconds: float
    simulate_seconds: float
