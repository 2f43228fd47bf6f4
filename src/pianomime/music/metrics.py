"""Metrics: how well the keys, notes and pedal of a performance match those of the score."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

ONSET_TOLERANCE = 0.05
"""[s] Greatest difference of matching onsets, as is usual in music transcription (mir_eval)."""


class FrameMetrics(NamedTuple):
    """Means over all frames, each 0..1."""

    precision: float
    recall: float
    f1: float


def frame_metrics(wanted: ArrayLike, pressed: ArrayLike) -> FrameMetrics:
    """Precision, recall and F1 of the pressed keys in each frame, averaged over frames.

    The metric of RoboPianist and PianoMime. Undefined values count as 1: the precision of a frame
    in which no key is pressed, the recall of one in which no key is wanted. So a silent frame with
    no key pressed counts 1 in all three. F1 is 2 tp / (2 tp + fp + fn), scikit-learn's definition
    since 1.3 with `zero_division=1` (note I of the PianoMime paper).

    Args:
        wanted: (T, 88) bool, roll of the score.
        pressed: (T, 88) bool, keys that were down.

    Raises:
        ValueError: the shapes differ or are not (T, keys), or there are no frames.
    """
    wanted, pressed = _same_shape(wanted, pressed, dimensions=2)
    if len(wanted) == 0:
        raise ValueError("no frames to measure")
    hits = (wanted & pressed).sum(axis=1)
    n_wanted, n_pressed = wanted.sum(axis=1), pressed.sum(axis=1)
    return FrameMetrics(
        precision=float(_ratio(hits, n_pressed).mean()),
        recall=float(_ratio(hits, n_wanted).mean()),
        f1=float(_ratio(2 * hits, n_wanted + n_pressed).mean()),
    )


def pedal_f1(wanted: ArrayLike, played: ArrayLike) -> float:
    """F1 of the frames with the pedal down; 1 if it is never down in either.

    Args:
        wanted: (T,) bool, pedal of the score.
        played: (T,) bool, pedal of the performance.

    Raises:
        ValueError: the shapes differ or are not (T,).
    """
    wanted, played = _same_shape(wanted, played, dimensions=1)
    return float(_ratio(2 * (wanted & played).sum(), wanted.sum() + played.sum()))


def onset_f1(
    wanted: tuple[ArrayLike, ArrayLike],
    played: tuple[ArrayLike, ArrayLike],
    tolerance: float = ONSET_TOLERANCE,
) -> float:
    """F1 of note onsets: a match has the same key, and onsets within the tolerance.

    Each note is matched at most once and the number of matches is the largest possible, as in
    mir_eval's onset-only transcription metric; as there, times are rounded to 0.1 ms, so that a
    difference of exactly the tolerance is a match. No notes in either counts 1.

    Args:
        wanted: key (N,) and onset (N,) [s] of the notes of the score.
        played: key (M,) and onset (M,) [s] of the notes that were played.
        tolerance: greatest difference of two onsets that match [s].

    Raises:
        ValueError: keys and onsets have different shapes, or not (N,).
    """
    wanted_key, wanted_onset = _by_key(*wanted)
    played_key, played_onset = _by_key(*played)
    if len(wanted_key) + len(played_key) == 0:
        return 1.0
    # All windows have the same length, so a greedy match is the largest: on each key, pair the
    # earliest two notes that are close enough, else skip the earlier one.
    hits = i = j = 0
    while i < len(wanted_key) and j < len(played_key):
        late = round(played_onset[j] - wanted_onset[i], 4)
        if (played_key[j], late) < (wanted_key[i], -tolerance):
            j += 1
        elif (played_key[j], late) > (wanted_key[i], tolerance):
            i += 1
        else:
            hits, i, j = hits + 1, i + 1, j + 1
    return 2 * hits / (len(wanted_key) + len(played_key))


def _by_key(key: ArrayLike, onset: ArrayLike) -> tuple[list[int], list[float]]:
    """Notes sorted by key, then onset."""
    keys, onsets = np.asarray(key), np.asarray(onset)
    if keys.ndim != 1 or keys.shape != onsets.shape:
        raise ValueError(f"keys {keys.shape} and onsets {onsets.shape} must both be (N,)")
    order = np.lexsort((onsets, keys))
    return keys[order].tolist(), onsets[order].tolist()


def _ratio(part: ArrayLike, whole: ArrayLike) -> NDArray[np.float64]:
    """Part / whole, and 1 where the whole is 0."""
    whole = np.asarray(whole, np.float64)
    ratio = np.ones_like(whole)
    np.divide(part, whole, out=ratio, where=whole > 0)
    return ratio


def _same_shape(
    one: ArrayLike, other: ArrayLike, dimensions: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    first, second = np.asarray(one, bool), np.asarray(other, bool)
    if first.shape != second.shape or first.ndim != dimensions:
        raise ValueError(f"cannot compare arrays of shapes {first.shape} and {second.shape}")
    return first, second
