"""Moments of a video to look at: where confidence in the demonstration is lowest, and why."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, key_name
from pianomime.plan import LEFT, RIGHT
from pianomime.video.confidence import DOUBT, Confidence
from pianomime.video.retarget import Retargeted

_WORST = 4
"""Moments with the lowest confidence."""
_APART = 1.0
"""[s] Least time between two of them; in a longer video it is `_SHARE_APART` of it."""
_SHARE_APART = 0.08
_ABOUT = 1.0
"""[s] Notes up to so far from a frame are named as the reason for its confidence."""
_NAMED = 4
"""Most notes that are named."""
_BEST = 0.75
"""Quantile of the confidence from which a moment is a good one."""
_FULL = 0.9
"""Confidence, and parts of it, from which nothing is poor."""


@dataclass(frozen=True)
class Moment:
    """A frame of the video, and why it is shown.

    Attributes:
        frame: number of the frame.
        confidence: in it, 0..1.
        reason: what lowers it.
    """

    frame: int
    confidence: float
    reason: str


def worst_moments(made: Retargeted) -> list[Moment]:
    """The moments with the lowest confidence, well apart in time, in order of time.

    Args:
        made: the retargeted video.
    """
    busy = _pressed(made)
    # Of frames alike, those in which something is played show more; a title shows nothing.
    rank = np.where(made.confidence.missing, np.inf, made.confidence.frames - 1e-3 * busy)
    apart = round(max(_APART * FRAME_RATE, _SHARE_APART * len(rank)))
    chosen: list[int] = []
    for _ in range(_WORST):
        number = int(np.argmin(rank))
        if not np.isfinite(rank[number]):
            break
        chosen.append(number)
        rank[max(0, number - apart) : number + apart + 1] = np.inf
    # Where nothing is poor, one picture is enough.
    low = [number for number in chosen if made.confidence.frames[number] < _FULL]
    chosen = low or chosen[:1]
    shown = sorted({_telling(made, number) for number in chosen})
    return [moment(made, number) for number in shown]


def good_moment(made: Retargeted) -> Moment | None:
    """The busiest of the moments with the highest confidence; None if all are in doubt.

    Args:
        made: the retargeted video.
    """
    frames, shown = made.confidence.frames, ~made.confidence.missing
    if frames.max() < DOUBT:
        return None
    good = np.flatnonzero(shown & (frames >= np.quantile(frames[shown], _BEST)))
    number = int(good[_pressed(made)[good].argmax()])
    return moment(made, number)


def moment(made: Retargeted, number: int) -> Moment:
    """A frame, and what lowers confidence in it.

    Args:
        made: the retargeted video.
        number: of the frame.
    """
    reasons = "; ".join(_reasons(made, number)) or "nothing lowers it much"
    return Moment(number, float(made.confidence.frames[number]), reasons)


def _pressed(made: Retargeted) -> NDArray[np.int64]:
    """(T,) Number of keys that are pressed in every frame."""
    pressed = np.zeros(len(made.tracks), np.int64)
    count = (made.demonstration.plan.finger_key >= 0).sum(axis=(1, 2))[: len(pressed)]
    pressed[: len(count)] = count
    return pressed


def _telling(made: Retargeted, number: int) -> int:
    """The frame near this one that shows best what lowers confidence in it."""
    confidence = made.confidence
    others = min(confidence.keyboard[number], confidence.hands[number, confidence.in_video].mean())
    unsupported = _unsupported(made, number)
    if confidence.notes[number] > others or not len(unsupported):
        return number
    onset = made.demonstration.score.note_frames()[unsupported, 0]
    onset = np.minimum(onset, len(confidence.missing) - 1)
    onset = onset[~confidence.missing[onset]]
    return int(onset[np.abs(onset - number).argmin()]) if len(onset) else number


def _unsupported(made: Retargeted, number: int) -> NDArray[np.int64]:
    """Notes about a frame that have no finger on their key, in order of time."""
    score = made.demonstration.score
    near = np.abs(score.onset - number / FRAME_RATE) <= _ABOUT
    notes = np.flatnonzero(near & ~made.confidence.supported)
    return notes[np.argsort(score.onset[notes], kind="stable")]


def _reasons(made: Retargeted, number: int) -> Iterator[str]:
    confidence, tracks, score = made.confidence, made.tracks, made.demonstration.score
    for hand, name in ((LEFT, "left"), (RIGHT, "right")):
        if not confidence.in_video[hand] or confidence.hands[number, hand] >= _FULL:
            continue
        if tracks.found[number, hand]:
            yield f"points of the {name} hand were outliers, and are replaced"
        else:
            yield f"the {name} hand is not seen, and is interpolated"
    if confidence.keyboard[number] < _FULL:
        yield "the keyboard is hidden, or not where it is said to be"
    if confidence.notes[number] < _FULL:
        notes = _unsupported(made, number)
        names = [key_name(int(key)) for key in score.key[notes[:_NAMED]]]
        more = f" and {len(notes) - _NAMED} more" if len(notes) > _NAMED else ""
        if _everywhere(confidence):
            yield "in the whole video, notes agree with the fingers hardly better than by chance"
        if names:
            yield f"no finger on the keys of notes about it (red): {', '.join(names)}{more}"
        elif not _everywhere(confidence):
            yield "notes before and after it have no finger on their keys"


def _everywhere(confidence: Confidence) -> bool:
    """Whether the notes of the whole video agree with the fingers hardly better than by chance."""
    return confidence.agreement.beyond_chance < DOUBT
