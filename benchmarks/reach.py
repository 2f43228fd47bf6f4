"""Measure at which distances two fingers of a hand can hold keys, and write `plan/reach.json`.

For every two fingers on white or black keys: the smallest and the largest distance along the
keyboard at which inverse kinematics of the hand takes both within 3 mm of their targets. The
smallest is mostly negative, that is, the fingers are crossed, since the fingers of a hand do not
collide with each other. Right hand, thumb on the bass side; the left hand is its mirror image. Also
the distances of the fingertips of a relaxed hand from its middle finger. About a minute on two
cores.

    python benchmarks/reach.py
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from itertools import combinations, product
from pathlib import Path

import numpy as np

import common
from pianomime.files import atomic
from pianomime.plan import reach
from pianomime.plan.fingertip_plan import FINGERS
from pianomime.plan.joint_path import (
    BLACK_REST,
    HOME,
    WHITE_REST,
    PathConfig,
    PathProblem,
    smooth_path,
)
from pianomime.world.hand import Hand
from pianomime.world.layout import FINGER_COUNT, LAYOUT, POINT_COUNT

_FILE = Path(reach.__file__).with_name("reach.json")
_WITHIN = 0.003  # [m]
_STEP = 0.003  # [m] between the distances tried
_NEAREST, _FARTHEST = -0.18, 0.33  # [m] beyond the reach of any two fingers
_WHITE_X = (0.030, 0.050, 0.070)  # [m] where a white key is struck, in front of the black ones
_BLACK_X = (-0.065, -0.025, 0.010)
_PRESSED = 0.009  # [m] way down of a fingertip with its key


def distances(low: int, high: int, low_black: bool, high_black: bool) -> tuple[float, float]:
    """The smallest and the largest distance [m] at which two fingers reach their targets."""
    hand = Hand("rh")
    # Posture hardly counts, because the limits of the joints are measured, not comfort.
    config = PathConfig(
        posture=30.0, slide_posture=1.0, coupling=0.5, damping=0.5, iterations=30,
        joint_acceleration=1e6, slide_acceleration=1e6,
    )  # fmt: skip
    tried = np.arange(_NEAREST, _FARTHEST, _STEP)
    reached = np.zeros(len(tried), bool)
    for low_x, high_x in product(_xs(low_black), _xs(high_black)):
        targets = np.zeros((len(tried), POINT_COUNT, 3))
        weights = np.zeros((len(tried), POINT_COUNT, 3))
        for finger, x, black, side in (
            (low, low_x, low_black, -0.5),
            (high, high_x, high_black, 0.5),
        ):
            height = (BLACK_REST if black else WHITE_REST) - _PRESSED
            targets[:, 1 + finger] = [x, 0.0, height]
            targets[:, 1 + finger, 1] = side * tried
            weights[:, 1 + finger] = 1 / 0.0005
        clearance = np.full((len(tried), FINGER_COUNT), np.nan)
        start = np.zeros(LAYOUT.hand_joints)
        path = smooth_path(PathProblem(hand, start, targets, weights, clearance, config))
        points = np.array([hand.points(pose) for pose in path[1:]])
        error = np.linalg.norm((points - targets)[:, [1 + low, 1 + high]], axis=-1).max(axis=1)
        reached |= error <= _WITHIN
    return float(tried[reached].min()), float(tried[reached].max())


def _xs(black: bool) -> tuple[float, ...]:
    return _BLACK_X if black else _WHITE_X


def main() -> None:
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    hand = Hand("rh")
    along = hand.points(np.clip(HOME, hand.low, hand.high))[1:, 1]
    colours = list(product((False, True), repeat=2))
    pairs = [(*fingers, *on) for fingers in combinations(range(FINGER_COUNT), 2) for on in colours]
    with ProcessPoolExecutor(len(common.cores())) as pool:
        found = list(pool.map(distances, *zip(*pairs, strict=True)))
    rows = [
        {
            "fingers": [low, high],
            "black": [low_black, high_black],
            "least": round(least, 3),
            "most": round(most, 3),
        }
        for (low, high, low_black, high_black), (least, most) in zip(pairs, found, strict=True)
    ]
    lines = ",\n".join("    " + json.dumps(row) for row in rows)
    ease = json.dumps([round(float(tip - along[2]), 4) for tip in along])
    with atomic(_FILE) as temporary:
        temporary.write_text(f'{{\n  "ease": {ease},\n  "pairs": [\n{lines}\n  ]\n}}\n', "utf-8")
    common.table(
        ["fingers", "on black", "least [mm]", "most [mm]"],
        [
            [
                " ".join(FINGERS[finger] for finger in row["fingers"]),
                " ".join("yes" if black else "no" for black in row["black"]),
                round(1000 * row["least"]),
                round(1000 * row["most"]),
            ]
            for row in rows
        ],
    )
    print(f"\nwritten: {_FILE}")


if __name__ == "__main__":
    main()
