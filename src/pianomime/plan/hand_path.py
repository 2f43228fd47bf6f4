"""Smooth, feasible fingertip paths of the robot's hands for a given fingering."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, NO_KEY
from pianomime.plan.fingertip_plan import FingertipPlan
from pianomime.plan.joint_path import KEY_REST, PathConfig, PathProblem
from pianomime.plan.keep_apart import smooth_paths
from pianomime.progress import Steps
from pianomime.validation import above_zero, finite
from pianomime.world.hand import Hand
from pianomime.world.layout import FINGER_COUNT, LAYOUT, POINT_COUNT
from pianomime.world.model import SIDES
from pianomime.world.parameters import key_centres

_WHITE_X = np.array([0.052, 0.042, 0.040, 0.042, 0.048])
"""(5,) World x at which each finger strikes white keys [m]: in front of the black keys, and the
short fingers, thumb and little finger, nearest to the player."""
_BLACK_X = np.array([0.004, 0.0, 0.0, 0.0, 0.004])
"""(5,) World x at which each finger strikes black keys [m]."""
_PRESS_DEPTH = 0.009
"""[m] Depth of a pressing fingertip below the top of the resting key."""
_APPROACH_FRAMES = 4
"""Frames before a press in which the finger comes to its key."""
# Deviation along x, y, z at which the cost of a fingertip's error is 1 [m].
_PRESS_TOLERANCE = np.array([0.008, 0.0015, 0.001])
_APPROACH_TOLERANCE = np.array([0.01, 0.003, 0.003])  # one frame before; grows with each
_RELEASE_TOLERANCE = np.array([0.01, 0.004, 0.002])


@dataclass(frozen=True)
class HandPathConfig:
    """Paths of the hands over the keys."""

    path: PathConfig = field(
        default_factory=lambda: PathConfig(
            joint_acceleration=150.0, slide_acceleration=20.0, iterations=16
        )
    )
    """Weights of the joint path that the fingertips follow."""
    hover: float = 0.010
    """Height of idle fingertips above the keys [m]."""
    approach: float = 0.004
    """Height of a fingertip above its key in the frame before it presses [m]."""
    lift: float = 0.003
    """Height of a fingertip above its key in the frame after it releases it [m]."""
    alike: float = 0.03
    """Deviation of an idle fingertip from the given hands at which its cost is 1 [m]."""
    alike_wrist: float = 0.05
    """Deviation of a wrist from the given hands along the keyboard at which its cost is 1 [m]."""

    def __post_init__(self) -> None:
        finite(self)
        for name in ("alike", "alike_wrist"):
            above_zero(name, getattr(self, name))


class HandPaths:
    """Points of both hands that move smoothly from rest and press the given keys.

    They are planned from the first frame on, all at once or some frames at a time.

    Args:
        finger_key: (T, 2, 5) key that each finger presses, -1 for none.
        config: heights and weights.
        others: (T, 2, 6, 3) points of other hands, such as a human's, that wrists and idle
            fingers stay near, world frame [m]; None for no such preference.

    Attributes:
        fingertips: (T, 2, 6, 3) points, world frame [m]; z is 0 for fingers that press. It is
            written into: after the frames that are planned come those that were looked ahead at,
            whose points are not final, and then hands at rest.
        joints: (T, 2, 27) joint positions that have these points [rad, m], but for the depth of
            fingers that press; written into likewise.
        planned: number of frames that are.
    """

    def __init__(
        self,
        finger_key: NDArray[np.int8],
        config: HandPathConfig | None = None,
        others: NDArray[np.floating] | None = None,
    ) -> None:
        self._config = config or HandPathConfig()
        self._pressing = finger_key >= 0
        self._problems = []
        self._before = [np.zeros((2, LAYOUT.hand_joints)) for _ in SIDES]
        self.fingertips: NDArray[np.float64] = np.empty((len(finger_key), 2, POINT_COUNT, 3))
        self.joints: NDArray[np.float64] = np.zeros((len(finger_key), 2, LAYOUT.hand_joints))
        self.planned = 0
        for index, side in enumerate(SIDES):
            targets, weights, clearance = _targets(finger_key[:, index], self._config)
            if others is not None:
                idle = (weights == 0).all(axis=2)
                idle[:, 0] = False
                targets[idle, :2] = others[:, index][idle, :2]
                weights[idle, :2] = 1 / self._config.alike
                targets[:, 0] = others[:, index, 0]
                weights[:, 0, 1] = 1 / self._config.alike_wrist
            hand, start = Hand(side), self._before[index][1]
            self._problems.append(
                PathProblem(hand, start, targets, weights, clearance, self._config.path)
            )
            self.fingertips[:, index] = hand.points(start)

    def extend(self, stop: int, ahead: int = 0) -> None:
        """Plan more frames.

        Args:
            stop: frame before which the plan then ends.
            ahead: frames after it that are looked at as well, so that the hands are where they
                must be next; what is planned of them is not final.
        """
        first, end = self.planned, min(stop + ahead, len(self.fingertips))
        steps = Steps("hand paths", len(SIDES) * self._config.path.iterations * (end - first))
        parts = [
            problem.part(first, end, before)
            for problem, before in zip(self._problems, self._before, strict=True)
        ]
        for index, path in enumerate(smooth_paths(parts, steps.advance)):
            points = parts[index].hand.points_along(path[1:])
            points[:, 1:, 2][self._pressing[first:end, index]] = 0.0
            self.fingertips[first:end, index] = points
            self.joints[first:end, index] = path[1:]
            self._before[index] = path[stop - first - 1 : stop - first + 1]
        self.planned = stop


def hand_paths(
    finger_key: NDArray[np.int8],
    config: HandPathConfig | None = None,
    others: NDArray[np.floating] | None = None,
) -> NDArray[np.float64]:
    """(T, 2, 6, 3) Points [m], as of `HandPaths`, which has the same arguments, all at once."""
    paths = HandPaths(finger_key, config, others)
    paths.extend(len(finger_key))
    return paths.fingertips


def make_feasible(plan: FingertipPlan, config: HandPathConfig | None = None) -> FingertipPlan:
    """Retarget a plan to the robot's hands: the same fingers on the same keys.

    Human hands have other proportions, and their tracking is inexact; so are predictions.
    Fingering is kept as it is; fingertip positions are only a soft target of the wrists and of idle
    fingers.

    Args:
        plan: that of a human, or of a high-level policy.
        config: heights and weights.
    """
    feasible = hand_paths(plan.finger_key, config, plan.fingertips)
    return replace(plan, fingertips=feasible, joints=None)


def _targets(
    finger_key: NDArray[np.int8], config: HandPathConfig
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Targets, weights and clearance of one hand, as `smooth_path` takes them.

    Args:
        finger_key: (T, 5) key that each finger presses, -1 for none.
        config: heights.
    """
    frames = len(finger_key)
    targets = np.zeros((frames, POINT_COUNT, 3))
    weights = np.zeros((frames, POINT_COUNT, 3))
    clearance = np.full((frames, FINGER_COUNT), config.hover)
    centres = key_centres()
    for finger in range(FINGER_COUNT):
        for first, end, key in _presses(finger_key[:, finger]):
            point = np.array(
                [(_BLACK_X if BLACK[key] else _WHITE_X)[finger], centres[key, 1], KEY_REST[key]]
            )
            down = slice(first, end)
            targets[down, finger + 1] = point - [0.0, 0.0, _PRESS_DEPTH]
            weights[down, finger + 1] = 1 / _PRESS_TOLERANCE
            clearance[down, finger] = np.nan
            for lead in range(1, _APPROACH_FRAMES + 1):
                frame = first - lead
                if frame < 0 or finger_key[frame, finger] != NO_KEY:
                    break
                targets[frame, finger + 1] = point + [0, 0, config.approach * lead]
                weights[frame, finger + 1] = 1 / (_APPROACH_TOLERANCE * lead)
                clearance[frame, finger] = min(config.hover, config.approach * lead)
            if end < frames and finger_key[end, finger] == NO_KEY:
                targets[end, finger + 1] = point + [0, 0, config.lift]
                weights[end, finger + 1] = 1 / _RELEASE_TOLERANCE
                clearance[end, finger] = config.lift
    return targets, weights, clearance


def _presses(keys: NDArray[np.int8]) -> list[tuple[int, int, int]]:
    """Presses (first frame, end, key) of one finger, given its keys (T,)."""
    edges = np.flatnonzero(np.diff(keys, prepend=NO_KEY, append=NO_KEY))
    return [
        (int(first), int(end), int(keys[first]))
        for first, end in pairwise(edges)
        if keys[first] != NO_KEY
    ]
