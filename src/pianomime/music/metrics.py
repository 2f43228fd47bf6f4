"""How well what was played matches what was wanted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class FrameMetrics(NamedTuple):
    """Means over all frames, each 0..1."""

    precision: float
    recall: float
    f1: float


def frame_metrics(wanted: ArrayLike, pressed: ArrayLike) -> FrameMetrics:
    """Precision, recall and F1 of the pressed keys in each frame, averaged over frames.

    The metric of RoboPianist and PianoMime: what is undefined counts as 1 (precision of a frame
    in which nothing is pressed, recall of one in which nothing is wanted), so a silent frame with
    no key pressed counts 1 in all three. F1 is 2 tp / (2 tp + fp + fn), scikit-learn's definition
    since 1.3 with `zero_division=1` (note I of the PianoMime paper).

    Args:
        wanted: (T, 88) bool, the roll of the score.
        pressed: (T, 88) bool, the keys that were down.

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
    """F1 of the frames with the pedal down; 1 if it is down in neither.

    Args:
        wanted: (T,) bool.
        played: (T,) bool.

    Raises:
        ValueError: the shapes differ or are not (T,).
    """
    wanted, played = _same_shape(wanted, played, dimensions=1)
    return float(_ratio(2 * (wanted & played).sum(), wanted.sum() + played.sum()))


def onset_f1(
    wanted: tuple[ArrayLike, ArrayLike],
    played: tuple[ArrayLike, ArrayLike],
    tolerance: float = 0.05,
) -> float:
    """F1 of the struck notes: same key, onsets no further apart than the tolerance.

    Each note is matched at most once and the number of matches is the largest possible, as in
    mir_eval's onset-only transcription metric; as there, times count to 0.1 ms, so that a
    difference of exactly the tolerance is a match. Silence played as silence counts 1.

    Args:
        wanted: key (N,) and onset (N,) [s] of the notes of the score.
        played: key (M,) and onset (M,) [s] of the notes that were played.
        tolerance: [s].
    """
    wanted_key, wanted_onset = _by_key(*wanted)
    played_key, played_onset = _by_key(*played)
    if len(wanted_key) + len(played_key) == 0:
        return 1.0
    # On one key, all windows have the same length: pairing the earliest two that are close enough,
    # and otherwise passing over the earlier one, matches as many as can be.
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
    """Part / whole, with 0 / 0 = 1."""
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
