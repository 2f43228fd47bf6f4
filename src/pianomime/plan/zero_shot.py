"""The planner that needs no demonstration: fingering by search, then smooth hand paths."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pianomime.music import Score
from pianomime.plan.fingering import Fingering, find_fingering
from pianomime.plan.fingertip_plan import NO_KEY, FingertipPlan
from pianomime.plan.hand_cost import FingeringConfig
from pianomime.plan.joint_path import KEY_REST, PathConfig, smooth_path
from pianomime.world.figures import BLACK, HAND_JOINTS, key_centres
from pianomime.world.hand import SIDES, Hand

# Where along a white key each finger strikes it: in front of the black keys, thumb and little
# finger, the short ones, nearest the player [m].
_WHITE_X = np.array([0.052, 0.042, 0.040, 0.042, 0.048])
_BLACK_X = np.array([0.004, 0.0, 0.0, 0.0, 0.004])


@dataclass(frozen=True)
class ZeroShotConfig:
    """The zero-shot planner."""

    fingering: FingeringConfig = field(default_factory=FingeringConfig)
    path: PathConfig = field(
        default_factory=lambda: PathConfig(
            joint_acceleration=150.0, slide_acceleration=20.0, iterations=16
        )
    )
    hover: float = 0.010
    """[m] that idle fingertips stay above the keys."""
    approach: float = 0.004
    """[m] above its key that a finger waits in the frame before it presses."""
    lift: float = 0.003
    """[m] above its key that a finger is in the frame after it let go."""


class ZeroShotPlanner:
    """Plans any score; what ten fingers cannot reach is left out and counted."""

    def __init__(self, config: ZeroShotConfig | None = None) -> None:
        self.config = config or ZeroShotConfig()

    def plan(self, score: Score) -> FingertipPlan:
        """One row for each frame of `score.roll()`."""
        fingering = find_fingering(score, self.config.fingering)
        finger_key = finger_keys(score, fingering)
        fingertips = np.empty((len(finger_key), 2, 6, 3))
        for index, side in enumerate(SIDES):
            hand = Hand(side)
            targets, weights, clearance = self._wishes(finger_key[:, index])
            path = smooth_path(
                hand, np.zeros(HAND_JOINTS), targets, weights, clearance, self.config.path
            )
            fingertips[:, index] = [hand.points(pose) for pose in path[1:]]
            pressing = finger_key[:, index] >= 0
            fingertips[:, index, 1:, 2][pressing] = 0.0
        return FingertipPlan(fingertips, finger_key, fingering.hand, fingering.finger)

    def _wishes(
        self, finger_key: NDArray[np.int8]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Targets, weights and clearance of one hand's points, from the keys (T, 5) it presses."""
        frames = len(finger_key)
        targets = np.zeros((frames, 6, 3))
        weights = np.zeros((frames, 6, 3))
        clearance = np.full((frames, 5), self.config.hover)
        centres = key_centres()
        for finger in range(5):
            for first, end, key in _presses(finger_key[:, finger]):
                point = np.array(
                    [(_BLACK_X if BLACK[key] else _WHITE_X)[finger], centres[key, 1], KEY_REST[key]]
                )
                down = slice(first, end)
                targets[down, finger + 1] = point - [0.0, 0.0, 0.009]
                weights[down, finger + 1] = 1 / np.array([0.008, 0.0015, 0.001])
                clearance[down, finger] = np.nan
                for lead in range(1, 5):
                    frame = first - lead
                    if frame < 0 or finger_key[frame, finger] != NO_KEY:
                        break
                    targets[frame, finger + 1] = point + [0, 0, self.config.approach * lead]
                    weights[frame, finger + 1] = 1 / (np.array([0.01, 0.003, 0.003]) * lead)
                    clearance[frame, finger] = min(self.config.hover, self.config.approach * lead)
                if end < frames and finger_key[end, finger] == NO_KEY:
                    targets[end, finger + 1] = point + [0, 0, self.config.lift]
                    weights[end, finger + 1] = 1 / np.array([0.01, 0.004, 0.002])
                    clearance[end, finger] = self.config.lift
        return targets, weights, clearance


def finger_keys(score: Score, fingering: Fingering) -> NDArray[np.int8]:
    """(T, 2, 5) int8: the key each finger presses in each frame, as the score's roll has it."""
    keys = np.full((score.frames(), 2, 5), NO_KEY, np.int8)
    for note in np.flatnonzero(fingering.hand >= 0):
        down = slice(fingering.start[note], fingering.stop[note])
        keys[down, fingering.hand[note], fingering.finger[note]] = score.key[note]
    return keys


def _presses(keys: NDArray[np.int8]) -> list[tuple[int, int, int]]:
    """Runs (first frame, end, key) of one finger's keys (T,)."""
    edges = np.flatnonzero(np.diff(keys, prepend=NO_KEY, append=NO_KEY))
    return [
        (int(first), int(end), int(keys[first]))
        for first, end in pairwise(edges)
        if keys[first] != NO_KEY
    ]
