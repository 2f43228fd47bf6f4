"""From hands seen frame by frame to two tracks, left and right, without holes or jitter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from pianomime.plan import LEFT, RIGHT
from pianomime.video.hand_detector import Sighting
from pianomime.video.plane import Plane
from pianomime.video.stretches import stretches

_SAME_HAND = 0.05
"""[m] Two sightings whose points are nearer than this on average are one hand seen twice."""
_JUMP = 0.10
"""[m] a frame: a hand that moves as far costs as much as a wrong label that is quite sure."""
_GHOST = 3.0
"""Cost of taking a sighting for no hand at all."""
_ORDER = 4.0
"""Cost of the right hand lying to the left of the left one."""
_HISTORIES = 3
"""Ways to tell the hands apart that are followed."""
_STRAY = 0.025
"""[m] A point this far from where its neighbours in time have it was seen wrongly."""
_SMOOTH = 5
"""Frames that are smoothed together, with a parabola, which has no lag."""
_AT_EASE = np.array(
    [[0.19, 0.0], [0.055, 0.1], [0.0, 0.03], [-0.005, 0.0], [0.0, -0.025], [0.01, -0.05]]
)
"""(6, 2) [m] of a left hand that is never seen, about its place along the keyboard."""


@dataclass(frozen=True, eq=False)
class HandTracks:
    """Both hands in every frame.

    Attributes:
        points: (T, 2, 6, 2) world x, y [m]; hands (left, right); points as in `plan.POINTS`.
        found: (T, 2) bool, hands that were seen in a frame; the others are filled in.
        mended: (T, 2, 6) bool, points that were seen but wrongly, and filled in.
        ghosts: number of sightings that were taken for no hand.
        swaps: number of frames in which MediaPipe took left for right.
    """

    points: NDArray[np.float64]
    found: NDArray[np.bool_]
    mended: NDArray[np.bool_]
    ghosts: int
    swaps: int

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.points)


def follow(
    sightings: Sequence[Sequence[Sighting]], size: tuple[int, int], plane: Plane
) -> HandTracks:
    """Decide over the whole clip which sighting is which hand, then repair.

    Args:
        sightings: those of each frame, 20 a second.
        size: width and height of the picture [pixels].
        plane: of that picture.
    """
    seen = [
        _without_doubles([(plane.to_world(each.points * size), each.right) for each in frame])
        for frame in sightings
    ]
    doubles = sum(map(len, sightings)) - sum(map(len, seen))
    # In a mirror every left hand looks like a right one; who sits where tells.
    mirrored = _seen_in_mirror(seen)
    chosen, ghosts, swaps = _assign(seen, mirrored)
    points = np.full((len(seen), 2, 6, 2), np.nan)
    for frame, hands in enumerate(chosen):
        for hand, which in enumerate(hands):
            if which >= 0:
                points[frame, hand] = seen[frame][which][0]
    found = np.isfinite(points).all(axis=(2, 3))
    mended = np.zeros(points.shape[:3], bool)
    for hand in (LEFT, RIGHT):
        points[:, hand], mended[:, hand] = _repair(points[:, hand], hand)
    return HandTracks(points, found, mended & found[..., None], ghosts + doubles, swaps)


_Seen = tuple[NDArray[np.float64], float]


def _without_doubles(hands: list[_Seen]) -> list[_Seen]:
    """Points (6, 2) [m] and rightness of each hand; the surer one where it was seen twice."""
    kept: list[_Seen] = []
    for hand in sorted(hands, key=lambda each: -abs(each[1] - 0.5)):
        if not np.isfinite(hand[0]).all():
            continue
        far = [np.linalg.norm(hand[0] - other[0], axis=1).mean() > _SAME_HAND for other in kept]
        if all(far):
            kept.append(hand)
    return kept


def _seen_in_mirror(seen: list[list[_Seen]]) -> bool:
    difference = 0.0
    for frame in seen:
        if len(frame) == 2:
            left, right = sorted(frame, key=lambda hand: hand[0][:, 1].mean())
            difference += right[1] - left[1]
    return difference < 0


def _assign(seen: list[list[_Seen]], mirrored: bool) -> tuple[list[tuple[int, int]], int, int]:
    """For each frame which sighting is left and which right, -1 for none: the cheapest history.

    A history remembers where it last saw each hand; of those that end alike one is kept.
    """
    histories: dict[tuple[int, int], _History] = {(-1, -1): _History.start()}
    back: list[dict[tuple[int, int], tuple[int, int]]] = []
    for frame in seen:
        options = [
            (left, right)
            for left, right in permutations([*range(len(frame)), -1, -1], 2)
            if left != right or left < 0
        ]
        following: dict[tuple[int, int], _History] = {}
        came_from: dict[tuple[int, int], tuple[int, int]] = {}
        # Those far behind do not catch up.
        leading = sorted(histories, key=lambda key: histories[key].cost)[:_HISTORIES]
        for key in leading:
            history = histories[key]
            moves = history.moves(frame)
            for option in dict.fromkeys(options):
                longer = history.after(frame, option, moves, mirrored)
                if option not in following or longer.cost < following[option].cost:
                    following[option], came_from[option] = longer, key
        histories = following
        back.append(came_from)
    if not seen:
        return [], 0, 0
    here = min(histories, key=lambda key: histories[key].cost)
    chosen = []
    for came_from in reversed(back):
        chosen.append(here)
        here = came_from[here]
    chosen.reverse()
    ghosts = swaps = 0
    for frame, pick in zip(seen, chosen, strict=True):
        ghosts += len(frame) - sum(which >= 0 for which in pick)
        wrong = [
            which >= 0 and ((frame[which][1] > 0.5) != (hand == RIGHT)) != mirrored
            for hand, which in enumerate(pick)
        ]
        swaps += any(wrong)
    return chosen, ghosts, swaps


@dataclass(frozen=True, eq=False)
class _History:
    cost: float
    last: tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]
    age: tuple[int, int]

    @staticmethod
    def start() -> _History:
        return _History(0.0, (None, None), (0, 0))

    def moves(self, frame: list[_Seen]) -> list[list[float]]:
        """What it costs each hand to have gone to each sighting."""
        return [
            [
                0.0
                if before is None
                # The longer unseen, the farther it may have gone.
                else min((_distance(points, before) / _JUMP) ** 2 / (1 + age), 6.0)
                for points, _ in frame
            ]
            for before, age in zip(self.last, self.age, strict=True)
        ]

    def after(
        self,
        frame: list[_Seen],
        option: tuple[int, int],
        moves: list[list[float]],
        mirrored: bool,
    ) -> _History:
        """The history that goes on with an option: the sighting of each hand, -1 for none."""
        cost = self.cost + _GHOST * (len(frame) - sum(which >= 0 for which in option))
        last = list(self.last)
        age = [frames + 1 for frames in self.age]
        for hand, which in enumerate(option):
            if which < 0:
                continue
            points, right = frame[which]
            likely = right if (hand == RIGHT) != mirrored else 1 - right
            cost += moves[hand][which] - math.log(min(max(likely, 0.05), 0.95))
            last[hand], age[hand] = points, 0
        left, other = last
        if min(option) >= 0 and left is not None and other is not None:
            cost += _ORDER * bool(left[:, 1].mean() > other[:, 1].mean())
        return _History(cost, (last[0], last[1]), (age[0], age[1]))


def _distance(points: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """Mean distance [m] of points (6, 2) from others."""
    off = points - others
    return float(np.sqrt((off * off).sum(axis=1)).mean())


def _repair(
    points: NDArray[np.float64], hand: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """One hand's points (T, 6, 2): strays out, gaps filled, smoothed; and what strayed (T, 6)."""
    frames = len(points)
    stray = np.zeros((frames, 6), bool)
    if not np.isfinite(points).any():
        side = -1 if hand == LEFT else 1
        place = _AT_EASE * [1, 1 if hand == LEFT else -1] + [0.0, 0.2 * side]
        return np.broadcast_to(place, points.shape).copy(), stray
    if frames >= 3:
        between = (points[:-2] + points[2:]) / 2
        off = np.linalg.norm(points[1:-1] - between, axis=2)
        still = np.linalg.norm(points[2:] - points[:-2], axis=2)
        # A quick move is not a stray: there, before and after are apart.
        stray[1:-1] = off > _STRAY + still
    filled = points.copy()
    filled[stray] = np.nan
    time = np.arange(frames)
    for point in range(6):
        for axis in range(2):
            known = np.isfinite(filled[:, point, axis])
            filled[:, point, axis] = np.interp(time, time[known], filled[known, point, axis])
    if frames >= _SMOOTH:
        filled = savgol_filter(filled, _SMOOTH, 2, axis=0, mode="interp")
    return filled, stray


def poorly_seen(tracks: HandTracks) -> list[tuple[float, float, int]]:
    """Stretches of half a second or more in which a hand was not seen.

    Returns:
        From and to [s], and the hand; in order.
    """
    return sorted(
        (first, end, hand)
        for hand in (LEFT, RIGHT)
        for first, end in stretches(~tracks.found[:, hand])
    )
