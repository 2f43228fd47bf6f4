"""Paths that keep hands and fingers apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pianomime.plan.joint_path import HOME, WHITE_REST, PathConfig, PathProblem, smooth_path
from pianomime.plan.keep_apart import near, smooth_paths
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.model import FINGER_PREFIXES, SIDES
from pianomime.world.overlap import Overlap, overlap

HANDS = [Hand(side) for side in SIDES]
REST = np.zeros(LAYOUT.hand_joints)
APART = PathConfig(apart=0.002)
FRAMES = 12


def problems(
    wanted: list[dict[int, tuple[float, float]]], config: PathConfig, tolerance: float = 0.002
) -> list[PathProblem]:
    """Hands (left, right) whose points are to be at places (x, y) on white keys, to the end."""
    made = []
    for hand, points in zip(HANDS, wanted, strict=True):
        targets, weights = np.zeros((2, FRAMES, 6, 3))
        for point, (x, y) in points.items():
            targets[:, point] = [x, y, WHITE_REST]
            weights[4:, point] = 1 / tolerance
        clearance = np.full((FRAMES, 5), np.nan)
        made.append(PathProblem(hand, REST, targets, weights, clearance, config))
    return made


def overlap_of(paths: list[NDArray[np.float64]]) -> Overlap:
    """Of the frames of paths of both hands."""
    joints = np.empty((len(paths[0]), LAYOUT.hands_size))
    for index, path in enumerate(paths):
        joints[:, LAYOUT.among_hands(index)] = path
    return overlap(joints)


GROUPS = {
    "slides": LAYOUT.slides,
    "wrist": LAYOUT.wrist,
    **dict(zip(FINGER_PREFIXES, LAYOUT.finger_joints, strict=True)),
}
"""Joints of a hand that a place depends on, or does not, together."""


def test_rows_are_the_slopes_of_the_distances() -> None:
    """Oracle: finite differences, at poses in which fingers, and hands, touch."""
    draw = np.random.default_rng(0)
    paths = [np.clip(HOME + draw.normal(0, 0.1, (20, 27)), hand.low, hand.high) for hand in HANDS]
    paths[0][:, LAYOUT.slide], paths[1][:, LAYOUT.slide] = 0.1, -0.1
    there = near(paths, APART)
    places = [[*zip(rows.frame.tolist(), rows.residual.tolist(), strict=True)] for rows in there]
    met = sum(place in places[1] for place in places[0])
    assert 20 < met < len(places[0]) - 20
    for index, rows in enumerate(there):
        # Of a place of both hands each gives way by half.
        both = np.array([place in places[1 - index] for place in places[index]])
        for group, joints in GROUPS.items():
            right: list[bool] = []
            still: list[bool] = []
            for joint in range(joints.start, joints.stop):
                moved = [path.copy() for path in paths]
                moved[index][:, joint] += 1e-6
                after = near(moved, APART)[index]
                assert len(after.frame) == len(rows.frame)
                slope = (after.residual - rows.residual) / 1e-6
                wanted = rows.gradient[:, joint] / np.where(both, 2, 1)
                close = np.isclose(slope, wanted, rtol=0.02, atol=0.05)
                right += close[wanted != 0.0].tolist()
                still += close[wanted == 0.0].tolist()
            # The nearest place of two boxes jumps now and then.
            assert len(right) > 30, (index, group)
            assert np.mean(right) > 0.9, (index, group)
            assert np.mean(still) > 0.95, (index, group)


def test_hands_that_pass_through_each_other_are_planned_one_by_one() -> None:
    config = replace(APART, apart=0.0)
    made = problems([{2: (0.05, -0.1)}, {2: (0.05, 0.1), 4: (0.05, 0.15)}], config)
    for path, problem in zip(smooth_paths(made), made, strict=True):
        np.testing.assert_array_equal(path, smooth_path(problem))


def test_fingers_that_are_sent_into_each_other_stay_apart() -> None:
    """Index and ring finger to places that take the middle finger's."""
    wanted: list[dict[int, tuple[float, float]]] = [{}, {2: (0.045, 0.10), 4: (0.045, 0.115)}]
    inside = overlap_of(smooth_paths(problems(wanted, replace(APART, apart=0.0))))
    outside = overlap_of(smooth_paths(problems(wanted, APART)))
    assert inside.fingers.max() > 0.003
    assert outside.fingers.max() < 0.001


def test_hands_that_are_sent_into_each_other_stay_apart() -> None:
    wanted = [{3: (0.045, -0.03)}, {3: (0.045, 0.03)}]
    inside = overlap_of(smooth_paths(problems(wanted, replace(APART, apart=0.0), 0.02)))
    outside = overlap_of(smooth_paths(problems(wanted, APART, 0.02)))
    assert inside.hands.max() > 0.02
    assert outside.hands[6:].max() < 0.001


def test_fingers_that_are_far_apart_are_let_alone() -> None:
    far = [np.tile(HOME, (FRAMES, 1)) for _ in HANDS]
    far[0][:, LAYOUT.slide], far[1][:, LAYOUT.slide] = -0.2, 0.2
    assert all(len(rows.frame) == 0 for rows in near(far, replace(APART, apart=0.0001)))
