"""Smallest and largest distance at which two fingers of a hand can hold two keys.

The distances in `reach.json` are measured by inverse kinematics (`benchmarks/reach.py`).
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, KEYS
from pianomime.plan.fingertip_plan import LEFT
from pianomime.world.layout import FINGER_COUNT
from pianomime.world.parameters import key_centres

_REACH: dict[str, Any] = json.loads(
    resources.files("pianomime.plan").joinpath("reach.json").read_text("utf-8")
)

_SIDE_BY_SIDE = 0.011
"""[m] Least distance of two fingers that do not cross: a white and a black key side by side are no
nearer."""

EASE: NDArray[np.float64] = np.array(_REACH["ease"])
"""(5,) [m] Distance of each fingertip from the middle finger along the keyboard, in a relaxed right
hand; that of a left hand has the opposite sign."""


def pair_limits(low: int, high: int, low_black: bool, high_black: bool) -> tuple[float, float]:
    """The smallest and the largest distance [m] at which two fingers can hold keys.

    Args:
        low: finger of a right hand, 0 thumb .. 4 little.
        high: another finger, further from the thumb.
        low_black: whether `low` is on a black key.
        high_black: whether `high` is on a black key.

    Returns:
        Smallest and largest distance along the keyboard from `low` to `high` [m]; negative where
        the fingers cross.
    """
    return _limits()[low, high, low_black, high_black]


@cache
def _limits() -> dict[tuple[int, int, bool, bool], tuple[float, float]]:
    return {
        (*row["fingers"], *row["black"]): (row["least"], row["most"]) for row in _REACH["pairs"]
    }


@cache
def stretch(side: int, crossing: bool = True) -> NDArray[np.float64]:
    """How far a hand is stretched, or its fingers are crossed, to hold two keys.

    Args:
        side: `LEFT` or `RIGHT`.
        crossing: whether any two fingers may cross, as where they pass through each other; else
            only the thumb crosses others, as in the models of human fingering (Parncutt et al.
            1997).

    Returns:
        (5, 5, 89, 89) by finger, other finger, key and other key: 0 where the fingers lie as in
        a relaxed hand, 1 at the limit of reach, inf beyond it. It is 0 for a finger and itself,
        and for the 89th key, which stands for no key. Read-only.
    """
    along = key_centres()[:, 1]
    table = np.zeros((FINGER_COUNT, FINGER_COUNT, KEYS + 1, KEYS + 1))
    black = BLACK.astype(int)
    for low in range(FINGER_COUNT):
        for high in range(low + 1, FINGER_COUNT):
            distance = along[None, :] - along[:, None]  # from the key of `low` to that of `high`
            if side == LEFT:
                distance = -distance
            limits = np.array(
                [[pair_limits(low, high, bool(a), bool(b)) for b in (0, 1)] for a in (0, 1)]
            )
            least, most = np.moveaxis(limits[black[:, None], black[None, :]], -1, 0)
            ease = EASE[high] - EASE[low]
            share = np.where(
                distance > ease,
                (distance - ease) / (most - ease),
                (ease - distance) / (ease - least),
            )
            share[share > 1.0] = np.inf
            if low and not crossing:
                share[distance < _SIDE_BY_SIDE] = np.inf
            table[low, high, :KEYS, :KEYS] = share
            table[high, low, :KEYS, :KEYS] = share.T
    table.setflags(write=False)
    return table
