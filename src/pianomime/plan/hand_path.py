"""Where fingertips go for given fingers to press given keys: as the robot's hands can do it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, NO_KEY
from pianomime.plan.fingertip_plan import FingertipPlan
from pianomime.plan.joint_path import KEY_REST, PathConfig, smooth_path
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES
from pianomime.world.parameters import key_centres

# Where along a white key each finger strikes it: in front of the black keys, thumb and little
# finger, the short ones, nearest the player [m].
_WHITE_X = np.array([0.052, 0.042, 0.040, 0.042, 0.048])
_BLACK_X = np.array([0.004, 0.0, 0.0, 0.0, 0.004])


@dataclass(frozen=True)
class HandPathConfig:
    """Paths of hands over keys."""

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
    alike: float = 0.03
    """[m] from where others had it, that counts as 1: of a fingertip that does nothing."""
    alike_wrist: float = 0.05
    """[m] the same of a forearm, along the keyboard."""


def hand_paths(
    finger_key: NDArray[np.int8],
    config: HandPathConfig | None = None,
    others: NDArray[np.floating] | None = None,
) -> NDArray[np.float64]:
    """Fingertips (T, 2, 6, 3) [m] of hands that move smoothly from rest; z is 0 where they press.

    Args:
        finger_key: (T, 2, 5) the key that each finger presses, -1 for none.
        config: how.
        others: (T, 2, 6, 3) points [m] that they stay near, if any, where they press nothing.
    """
    config = config or HandPathConfig()
    fingertips = np.empty((len(finger_key), 2, 6, 3))
    for index, side in enumerate(SIDES):
        hand = Hand(side)
        targets, weights, clearance = _wishes(finger_key[:, index], config)
        if others is not None:
            idle = (weights == 0).all(axis=2)
            idle[:, 0] = False
            targets[idle, :2] = others[:, index][idle, :2]
            weights[idle, :2] = 1 / config.alike
            targets[:, 0] = others[:, index, 0]
            weights[:, 0, 1] = 1 / config.alike_wrist
        path = smooth_path(
            hand, np.zeros(LAYOUT.hand_joints), targets, weights, clearance, config.path
        )
        fingertips[:, index] = [hand.points(pose) for pose in path[1:]]
        fingertips[:, index, 1:, 2][finger_key[:, index] >= 0] = 0.0
    return fingertips


def make_feasible(plan: FingertipPlan, config: HandPathConfig | None = None) -> FingertipPlan:
    """A human's plan as the robot's hands can do it: the same fingers on the same keys.

    Human hands have other proportions, and what was seen of them is not exact. All that is taken
    of where the fingertips were is where hands and idle fingers are, and that only about.
    """
    return replace(plan, fingertips=hand_paths(plan.finger_key, config, plan.fingertips))


def _wishes(
    finger_key: NDArray[np.int8], config: HandPathConfig
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Targets, weights and clearance of one hand's points, from the keys (T, 5) it presses."""
    frames = len(finger_key)
    targets = np.zeros((frames, 6, 3))
    weights = np.zeros((frames, 6, 3))
    clearance = np.full((frames, 5), config.hover)
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
                targets[frame, finger + 1] = point + [0, 0, config.approach * lead]
                weights[frame, finger + 1] = 1 / (np.array([0.01, 0.003, 0.003]) * lead)
                clearance[frame, finger] = min(config.hover, config.approach * lead)
            if end < frames and finger_key[end, finger] == NO_KEY:
                targets[end, finger + 1] = point + [0, 0, config.lift]
                weights[end, finger + 1] = 1 / np.array([0.01, 0.004, 0.002])
                clearance[end, finger] = config.lift
    return targets, weights, clearance


def _presses(keys: NDArray[np.int8]) -> list[tuple[int, int, int]]:
    """Runs (first frame, end, key) of one finger's keys (T,)."""
    edges = np.flatnonzero(np.diff(keys, prepend=NO_KEY, append=NO_KEY))
    return [
        (int(first), int(end), int(keys[first]))
        for first, end in pairwise(edges)
        if keys[first] != NO_KEY
    ]
