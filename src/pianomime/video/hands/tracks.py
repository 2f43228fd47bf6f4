"""From hands seen frame by frame to two tracks, left and right, without holes or jitter."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from pianomime.plan import LEFT, RIGHT
from pianomime.video.hands.sightings import Sighting, Sightings
from pianomime.video.hands.strays import strays
from pianomime.video.keyboard.plane import Plane
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
FEWEST = 0.05
"""Share of the frames in which a hand must be seen to be one: less are ghosts."""
_AT_EASE = np.array(
    [[0.19, 0.0], [0.055, 0.1], [0.0, 0.03], [-0.005, 0.0], [0.0, -0.025], [0.01, -0.05]]
)
"""(6, 2) [m] of a left hand that is never seen, about its place along the keyboard."""


@dataclass(frozen=True, eq=False)
class HandTracks:
    """Both hands in every frame.

    Attributes:
        points: (T, 2, 6, 2) world x, y [m]; hands (left, right); points as in `plan.POINTS`.
            Single precision, a tenth of a micrometre: in hours, bytes count.
        found: (T, 2) bool, hands that were seen in a frame; the others are filled in. A hand that
            is hardly ever seen (`FEWEST`) is taken for a ghost: it is never found, and made up.
        mended: (T, 2, 6) bool, points that were seen but wrongly, and filled in.
        ghosts: number of sightings that were taken for no hand.
        swaps: number of frames in which MediaPipe took left for right.
    """

    points: NDArray[np.float32]
    found: NDArray[np.bool_]
    mended: NDArray[np.bool_]
    ghosts: int
    swaps: int

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.points)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(2,) hands that are there; the others are made up and play nothing."""
        return np.asarray(self.found.any(axis=0))

    def seen_points(self, step: int = 1) -> NDArray[np.float32]:
        """(ceil(T / step), H, 6, 2) of the H hands that are there, in every step-th frame."""
        points = self.points[::step]
        return points if self.seen.all() else points[:, self.seen]


def follow(
    sightings: Iterable[Iterable[Sighting]], size: tuple[int, int], plane: Plane
) -> HandTracks:
    """Decide over the whole clip which sighting is which hand, then repair.

    Args:
        sightings: those of each frame, 20 a second.
        size: width and height of the picture [pixels].
        plane: of that picture.
    """
    seen = Sightings()
    doubles = 0
    for frame in sightings:
        hands = [Sighting(plane.to_world(each.points * size), each.right) for each in frame]
        single = _without_doubles(hands)
        doubles += len(hands) - len(single)
        seen.append(single)
    # In a mirror every left hand looks like a right one; who sits where tells.
    mirrored = _seen_in_mirror(seen)
    chosen = _assign(seen, mirrored)
    points = np.full((len(seen), 2, 6, 2), np.nan, np.float32)
    ghosts = swaps = 0
    for number, (hands, pick) in enumerate(zip(seen, chosen, strict=True)):
        swapped = False
        for hand, which in enumerate(pick):
            if which >= 0:
                points[number, hand] = hands[which].points
                swapped |= ((hands[which].right > 0.5) != (hand == RIGHT)) != mirrored
        swaps += swapped
        ghosts += len(hands) - sum(which >= 0 for which in pick)
    found: NDArray[np.bool_] = np.asarray(np.isfinite(points).all(axis=(2, 3)))
    for hand in (LEFT, RIGHT):
        if found[:, hand].mean() < FEWEST:
            ghosts += int(found[:, hand].sum())
            points[:, hand], found[:, hand] = np.nan, False
    mended: NDArray[np.bool_] = np.zeros(points.shape[:3], bool)
    for hand in (LEFT, RIGHT):
        mended[:, hand] = _repair(points[:, hand], hand)
    mended &= found[..., None]
    return HandTracks(points, found, mended, ghosts + doubles, swaps)


def _without_doubles(hands: list[Sighting]) -> list[Sighting]:
    """Those of the hands, in the world, that are not another one again; the surer ones."""
    kept: list[Sighting] = []
    for hand in sorted(hands, key=lambda each: -abs(each.right - 0.5)):
        if not np.isfinite(hand.points).all():
            continue
        far = [
            np.linalg.norm(hand.points - other.points, axis=1).mean() > _SAME_HAND for other in kept
        ]
        if all(far):
            kept.append(hand)
    return kept


def _seen_in_mirror(seen: Sightings) -> bool:
    difference = 0.0
    for frame in seen:
        if len(frame) == 2:
            left, right = sorted(frame, key=lambda hand: float(hand.points[:, 1].mean()))
            difference += right.right - left.right
    return difference < 0


@cache
def _options(hands: int) -> tuple[tuple[int, int], ...]:
    """Every way to take one of the hands for the left and one for the right, -1 for none."""
    ways = permutations([*range(hands), -1, -1], 2)
    return tuple(dict.fromkeys(way for way in ways if way[0] != way[1] or way[0] < 0))


def _assign(seen: Sightings, mirrored: bool) -> list[tuple[int, int]]:
    """For each frame which sighting is left and which right, -1 for none: the cheapest history.

    A history remembers where it last saw each hand; of those that end alike one is kept.
    """
    histories = {0: _History.start()}
    # For each frame and option, the number of the option before: in hours, bytes count.
    back: list[bytes] = []
    for frame in seen:
        options = _options(len(frame))
        following: dict[int, _History] = {}
        came_from = bytearray(len(options))
        # Those far behind do not catch up.
        leading = sorted(histories, key=lambda number: histories[number].cost)[:_HISTORIES]
        for before in leading:
            history = histories[before]
            moves = history.moves(frame)
            for number, option in enumerate(options):
                longer = history.after(frame, option, moves, mirrored)
                if number not in following or longer.cost < following[number].cost:
                    following[number], came_from[number] = longer, before
        histories = following
        back.append(bytes(came_from))
    here = min(histories, key=lambda number: histories[number].cost)
    chosen = []
    for frame_number in reversed(range(len(seen))):
        chosen.append(_options(len(seen[frame_number]))[here])
        here = back[frame_number][here]
    chosen.reverse()
    return chosen


@dataclass(frozen=True, eq=False)
class _History:
    cost: float
    last: tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]
    age: tuple[int, int]

    @staticmethod
    def start() -> _History:
        return _History(0.0, (None, None), (0, 0))

    def moves(self, frame: list[Sighting]) -> list[list[float]]:
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
        frame: list[Sighting],
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


def _repair(points: NDArray[np.float32], hand: int) -> NDArray[np.bool_]:
    """In one hand's points (T, 6, 2) mend strays, fill gaps, smooth; what strayed (T, 6)."""
    frames = len(points)
    stray = np.zeros((frames, 6), bool)
    if not np.isfinite(points).any():
        points[:] = at_rest(hand)
        return stray
    time = np.arange(frames)
    # Point by point: hours of all of them at once take much memory.
    for point in range(6):
        stray[:, point] = strays(points[:, point], _STRAY)
        known = np.isfinite(points[:, point]).all(axis=1) & ~stray[:, point]
        for axis in range(2):
            course = np.interp(time, time[known], points[known, point, axis])
            if frames >= _SMOOTH:
                course = savgol_filter(course, _SMOOTH, 2, mode="interp")
            points[:, point, axis] = course
    return stray


def at_rest(hand: int) -> NDArray[np.float64]:
    """(6, 2) world x, y [m] of a hand that was never seen."""
    side = -1 if hand == LEFT else 1
    return _AT_EASE * [1, -side] + [0.0, 0.2 * side]


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
