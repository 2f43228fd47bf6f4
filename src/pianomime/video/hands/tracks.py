"""Tracking: from hands detected frame by frame to one gapless, smooth track of each hand.

Which detection is which hand is decided over the whole video, by the cheapest history (a beam
search over frames).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from pianomime.plan import LEFT, RIGHT
from pianomime.short_repr import short_repr
from pianomime.video.hands.repair import repair
from pianomime.video.hands.sightings import Sighting, Sightings
from pianomime.video.keyboard.track import KeyboardTrack

_SAME_HAND = 0.05
"""[m] Two detections whose points are closer than this on average are one hand detected twice."""
_JUMP = 0.10
"""[m] Movement in one frame that costs 1; the cost grows with its square."""
_GHOST = 3.0
"""Cost of taking a detection for neither hand."""
_ORDER = 4.0
"""Cost of a right hand to the left of the left hand."""
_HISTORIES = 3
"""Width of the beam."""
FEWEST = 0.05
"""Share of the frames with a keyboard in which a hand must be detected to be taken for one."""


@dataclass(frozen=True, eq=False)
class HandTracks:
    """Both hands in every frame.

    Attributes:
        points: (T, 2, 6, 2) world x, y [m]; hands (left, right); points as in `plan.POINTS`. In
            single precision, to save memory in hours of video; it resolves 0.1 micrometres.
        found: (T, 2) bool, frames in which each hand was detected; the others are interpolated. A
            hand in a smaller share of the frames than `FEWEST` is never found, and at rest.
        mended: (T, 2, 6) bool, points that were outliers and have been replaced.
        ghosts: number of detections that were taken for neither hand.
        swaps: number of frames in which MediaPipe mistook one hand for the other.
    """

    points: NDArray[np.float32]
    found: NDArray[np.bool_]
    mended: NDArray[np.bool_]
    ghosts: int
    swaps: int

    __repr__ = short_repr

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.points)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(2,) bool: hands that are in the video; the others are at rest and play nothing."""
        return np.asarray(self.found.any(axis=0))

    def seen_points(self, step: int = 1) -> NDArray[np.float32]:
        """(ceil(T / step), H, 6, 2) Points of the H hands in the video, every step-th frame [m]."""
        points = self.points[::step]
        return points if self.seen.all() else points[:, self.seen]


def nobody(frames: int) -> HandTracks:
    """The tracks of a video in which hands were not looked for, or are not.

    Args:
        frames: number of its frames.
    """
    return HandTracks(
        np.zeros((frames, 2, 6, 2), np.float32),
        np.zeros((frames, 2), bool),
        np.zeros((frames, 2, 6), bool),
        0,
        0,
    )


def follow(
    sightings: Iterable[Iterable[Sighting]], size: tuple[int, int], track: KeyboardTrack
) -> HandTracks:
    """Track both hands over the whole video.

    Args:
        sightings: hands detected in each frame, at 20 Hz, in shares of the picture's size.
        size: width and height of the picture [pixels].
        track: of the keyboard; hands are not followed where it is not seen.
    """
    seen = Sightings()
    doubles = 0
    for number, frame in enumerate(sightings):
        plane = track.at(number)
        if plane is None:
            seen.append([])
            continue
        hands = [Sighting(plane.to_world(each.points * size), each.right) for each in frame]
        single = _without_doubles(hands)
        doubles += len(hands) - len(single)
        seen.append(single)
    # In a mirrored video left hands look like right hands; their order along the keyboard decides.
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
    watched = len(seen) - int(track.missing(len(seen)).sum())
    for hand in (LEFT, RIGHT):
        if found[:, hand].sum() < FEWEST * watched:
            ghosts += int(found[:, hand].sum())
            points[:, hand], found[:, hand] = np.nan, False
    mended: NDArray[np.bool_] = np.zeros(points.shape[:3], bool)
    for hand in (LEFT, RIGHT):
        mended[:, hand] = repair(points[:, hand], hand)
    mended &= found[..., None]
    return HandTracks(points, found, mended, ghosts + doubles, swaps)


def _without_doubles(hands: list[Sighting]) -> list[Sighting]:
    """The hands, in the world, without those that were detected twice; the surer ones are kept."""
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
    """Whether left and right labels contradict the order of the hands along the keyboard."""
    difference = 0.0
    for frame in seen:
        if len(frame) == 2:
            left, right = sorted(frame, key=lambda hand: float(hand.points[:, 1].mean()))
            difference += right.right - left.right
    return difference < 0


@cache
def _options(hands: int) -> tuple[tuple[int, int], ...]:
    """Every choice of a left and a right hand among the detections of a frame, -1 for none."""
    ways = permutations([*range(hands), -1, -1], 2)
    return tuple(dict.fromkeys(way for way in ways if way[0] != way[1] or way[0] < 0))


def _assign(seen: Sightings, mirrored: bool) -> list[tuple[int, int]]:
    """For each frame the index of the left and of the right detection, -1 for none.

    A history remembers where each hand was last seen; of those with the same last choice, only
    the cheapest is kept.
    """
    histories = {0: _History.start()}
    # For each frame and option, the option of the frame before, as bytes to save memory.
    back: list[bytes] = []
    for frame in seen:
        options = _options(len(frame))
        following: dict[int, _History] = {}
        came_from = bytearray(len(options))
        # Only the cheapest histories go on.
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
    """One choice of hands in all frames so far: cost, last points and frames since, per hand."""

    cost: float
    last: tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]
    age: tuple[int, int]

    @staticmethod
    def start() -> _History:
        return _History(0.0, (None, None), (0, 0))

    def moves(self, frame: list[Sighting]) -> list[list[float]]:
        """Cost of the movement of each hand to each detection."""
        return [
            [
                0.0
                if before is None
                # A hand that was not seen for longer may have moved further.
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
        """The history with one more frame, given the detection of each hand, -1 for none."""
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
