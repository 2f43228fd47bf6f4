"""Body: whether hands could move as those of a performance did.

The metrics of notes know nothing of hands: one inside the other, or one that leaps with 500 N,
plays as well as another. `docs/concepts/body.md` describes each metric.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, KEYS
from pianomime.players.motion import FrameMotion, motion
from pianomime.players.performance import Performance
from pianomime.world.hand import hand_points
from pianomime.world.layout import LAYOUT
from pianomime.world.model import world_model
from pianomime.world.overlap import overlap
from pianomime.world.parameters import PHYSICS_DT

OVERLAP_DEPTH = 0.001
"""[m] Overlaps that are no deeper count as touching."""
FAST_JOINT = 10.0
"""[rad/s] A joint above this is faster than fingers of pianists."""
_END = 1e-9
"""Share of an actuator's range within which a control is at its end."""
_UPPER = 99.0
"""Percentile that stands for the upper end of speeds, in place of the one fastest instant."""

_OF_MOTION = (
    *("joint_speed_p99", "joint_speed_max", "joints_fast"),
    *("rail_speed_max", "rail_acceleration_max", "rail_force_max"),
    *("forces_at_limit", "forces_at_limit_worst"),
)
"""Metrics of what is between frames."""

HUMAN = {"wrist_speed_p99": 0.90, "wrist_jerk": 48.0, "fingertip_jerk": 76.7}
"""The same of human demonstrations, measured by `benchmarks/body.py`."""


@dataclass(frozen=True)
class BodyMetrics:
    """How the hands moved. None where there is nothing to measure, or it is invalid.

    An instant is a physics step of 5 ms; frames in which the physics broke are left out.

    Attributes:
        hands_overlap: share of frames in which one hand is inside the other by over 1 mm.
        hands_overlap_max: the deepest [m].
        fingers_overlap: share of frames in which two fingers of one hand are, likewise.
        fingers_overlap_max: the deepest [m].
        forearms_crossed: share of frames in which the left wrist is to the right of the right one.
        joint_speed_p99: of the fastest joint of wrists and fingers in each instant [rad/s].
        joint_speed_max: the greatest [rad/s].
        joints_fast: share of instants in which it is over 10 rad/s.
        rail_speed_max: of the three slides of both forearms [m/s].
        rail_acceleration_max: of these, from one instant to the next [m/s^2].
        rail_force_max: of their actuators [N].
        controls_at_end: share of controls at an end of their actuator's range.
        controls_at_end_worst: the same of the one actuator that has the greatest.
        forces_at_limit: share of instants and actuators with a limit at which the force is at it.
        forces_at_limit_worst: the same of the one actuator that has the greatest.
        wrist_speed_p99: along the keyboard, from frame to frame [m/s].
        wrist_jerk: median of the third difference over frames of the wrists' positions [m/s^3].
        fingertip_jerk: the same of the fingertips [m/s^3].
        invalid: names of the metrics that could not be computed, because what they are made of
            is not finite, or because playing the controls again gave another motion.
    """

    hands_overlap: float | None
    hands_overlap_max: float | None
    fingers_overlap: float | None
    fingers_overlap_max: float | None
    forearms_crossed: float | None
    joint_speed_p99: float | None
    joint_speed_max: float | None
    joints_fast: float | None
    rail_speed_max: float | None
    rail_acceleration_max: float | None
    rail_force_max: float | None
    controls_at_end: float | None
    controls_at_end_worst: float | None
    forces_at_limit: float | None
    forces_at_limit_worst: float | None
    wrist_speed_p99: float | None
    wrist_jerk: float | None
    fingertip_jerk: float | None
    invalid: tuple[str, ...]


def body_metrics(
    performance: Performance, frames: Iterable[FrameMotion] | None = None
) -> BodyMetrics:
    """Measure the hands of a performance, which is played again for it.

    Args:
        performance: with any number of controls a frame.
        frames: its motion, for who looks at that as well; by default that of
            `pianomime.players.motion.motion`.
    """
    moving = motion(performance) if frames is None else frames
    whole = np.ones(len(performance), bool)
    whole[performance.blow_ups] = False
    found = {
        **_of_poses(performance.qpos[:, KEYS:], whole),
        **_of_controls(performance.ctrl),
        **_of_motion(performance, moving, whole),
    }
    invalid = tuple(
        name for name, value in found.items() if value is not None and not np.isfinite(value)
    )
    return BodyMetrics(
        **{name: None if name in invalid else value for name, value in found.items()},
        invalid=invalid,
    )


def wrist_and_fingertip_motion(
    points: NDArray[np.float64], whole: NDArray[np.bool_]
) -> dict[str, float | None]:
    """`wrist_speed_p99`, `wrist_jerk` and `fingertip_jerk`, of a performance or of a human.

    Args:
        points: (T, 2, 6, 3) wrist and fingertips of both hands in every frame [m].
        whole: (T,) bool: the frames that count; differences over others are left out.
    """
    speed = _differences(points[:, :, 0, 1], whole, 1)
    jerk = np.linalg.norm(_differences(points, whole, 3), axis=-1)
    return {
        "wrist_speed_p99": _of(_upper, np.abs(speed)),
        "wrist_jerk": _of(np.median, jerk[:, :, 0]),
        "fingertip_jerk": _of(np.median, jerk[:, :, 1:]),
    }


def _of_poses(joints: NDArray[np.float64], whole: NDArray[np.bool_]) -> dict[str, float | None]:
    """Of the poses (T, 54) after each frame."""
    deep = overlap(joints[whole])
    fingers = deep.fingers.max(axis=1, initial=0.0)
    points = hand_points(joints)
    left, right = points[whole, :, 0, 1].T
    return {
        "hands_overlap": _share(deep.hands > OVERLAP_DEPTH, deep.hands),
        "hands_overlap_max": _of(np.max, deep.hands),
        "fingers_overlap": _share(fingers > OVERLAP_DEPTH, fingers),
        "fingers_overlap_max": _of(np.max, fingers),
        "forearms_crossed": _share(left > right, right - left),
        **wrist_and_fingertip_motion(points, whole),
    }


def _of_controls(ctrl: NDArray[np.float64]) -> dict[str, float | None]:
    """Of the controls (T, S, 46); those beyond an end are sent as that end."""
    low, high = world_model().actuator_ctrlrange.T
    slack = _END * (high - low)
    at_end = ((ctrl <= low + slack) | (ctrl >= high - slack)).astype(np.float64)
    return _mean_and_worst("controls_at_end", at_end, ctrl)


def _of_motion(
    performance: Performance, moving: Iterable[FrameMotion], whole: NDArray[np.bool_]
) -> dict[str, float | None]:
    """Of all instants in frames that are whole; NaN if it is another motion than was kept."""
    another: dict[str, float | None] = dict.fromkeys(_OF_MOTION, np.nan)
    if not np.isfinite(performance.ctrl).all():
        return another
    model = world_model(performance.world)
    hinges, rails, pushing = _joints_and_rails()
    limited = np.flatnonzero(model.actuator_forcelimited)
    limits = np.abs(model.actuator_forcerange[limited]).max(axis=1) * (1 - _END)
    # Only the greatest of each instant are kept: a performance may last for hours.
    instants: list[NDArray[np.float64]] = []
    at_limit: list[NDArray[np.float64]] = []
    for frame, moved in enumerate(moving):
        if not moved.same:
            return another
        if not whole[frame]:
            continue
        speed, pushed = np.abs(moved.velocity[1:]), np.abs(moved.force)
        change = np.abs(np.diff(moved.velocity[:, rails], axis=0)) / PHYSICS_DT
        parts = (speed[:, hinges], speed[:, rails], change, pushed[:, pushing])
        instants.append(np.stack([part.max(axis=1) for part in parts], axis=1))
        at_limit.append((pushed[:, limited] >= limits).mean(axis=0))
    joint, rail, changed, force = np.reshape(instants, (-1, 4)).T
    shares = np.reshape(at_limit, (-1, len(limited)))
    return {
        "joint_speed_p99": _of(_upper, joint),
        "joint_speed_max": _of(np.max, joint),
        "joints_fast": _share(joint > FAST_JOINT, joint),
        "rail_speed_max": _of(np.max, rail),
        "rail_acceleration_max": _of(np.max, changed),
        "rail_force_max": _of(np.max, force),
        **_mean_and_worst("forces_at_limit", shares, force),
    }


def _joints_and_rails() -> tuple[list[int], list[int], list[int]]:
    """Hinges and slides among the joints of both hands, and the slides' actuators."""
    hinges: list[int] = []
    rails: list[int] = []
    pushing: list[int] = []
    for hand in range(len(LAYOUT.joints)):
        joints, actuators = LAYOUT.among_hands(hand), LAYOUT.actuators[hand]
        slides = range(LAYOUT.slides.start, LAYOUT.slides.stop)
        rails += [joints.start + index for index in slides]
        hinges += [
            joints.start + index for index in range(LAYOUT.hand_joints) if index not in slides
        ]
        pushing += range(
            actuators.start + LAYOUT.slide_actuators.start,
            actuators.start + LAYOUT.slide_actuators.stop,
        )
    return hinges, rails, pushing


def _differences(
    values: NDArray[np.float64], whole: NDArray[np.bool_], order: int
) -> NDArray[np.float64]:
    """Differences of some order over frames, by the second; those over frames that count."""
    changed = np.diff(values, order, axis=0)
    kept = np.ones(len(changed), bool)
    for later in range(order + 1):
        kept &= whole[later : later + len(changed)]
    scaled: NDArray[np.float64] = changed[kept] * FRAME_RATE**order
    return scaled


def _upper(values: NDArray[np.float64]) -> np.floating:
    return np.percentile(values, _UPPER)


def _share(holds: NDArray[np.bool_], made_of: NDArray[np.float64]) -> float | None:
    """Share of the instants in which something holds."""
    return _of(np.mean, holds.astype(np.float64), made_of)


def _of(
    what: Callable[[NDArray[np.float64]], np.floating],
    values: NDArray[np.float64],
    made_of: NDArray[np.float64] | None = None,
) -> float | None:
    """A statistic of values; None of nothing, NaN if they are made of what is not finite."""
    if not values.size:
        return None
    finite = np.isfinite(values if made_of is None else made_of).all()
    return float(what(values)) if finite else np.nan


def _mean_and_worst(
    name: str, shares: NDArray[np.float64], made_of: NDArray[np.float64]
) -> dict[str, float | None]:
    """Shares of the actuators, which are last: the mean over all, and that of the greatest."""
    by_actuator = shares.reshape(-1, shares.shape[-1]).mean(axis=0) if shares.size else shares
    return {
        name: _of(np.mean, by_actuator, made_of),
        f"{name}_worst": _of(np.max, by_actuator, made_of),
    }
