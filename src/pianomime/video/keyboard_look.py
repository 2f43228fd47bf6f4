"""The look of the keyboard in a video: whether black and white keys are where they should be.

Patches of all keys, black and white, are read where the plane of the keyboard says they are. If it
is off by a part of a key, or by a few keys, black patches are where white keys are. An octave off
looks the same; only the ends of the keyboard tell it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from pianomime.keyboard import BLACK
from pianomime.short_repr import short_repr
from pianomime.video.film.light_record import LightRecord
from pianomime.video.notes.key_light import ZONES

_ZONES = [list(ZONES).index(name) for name in ("far end", "between the black keys")]
"""Indices of the zones in which black keys lie between white ones."""
_SOME_FRAMES = 2000
"""Frames from which the usual look is taken."""
_BESIDE = 13
"""Keys about a key, an octave, the brightest of which is what white looks like there: a part of the
keyboard may lie in shade."""
_FEWEST = 12
"""Keys, an octave, that must be in the picture to judge it."""


@dataclass(frozen=True, eq=False)
class KeyboardLook:
    """How much the keyboard in a video looks like one, and as it does most of the time.

    Attributes:
        pattern: correlation of the usual brightness of the keys with white and black; 1 if all of
            them are where they should be. None if their far ends are outside the picture.
        usual: (T,) correlation of each frame's brightness with the usual one; all 1 where
            `pattern` is None.
    """

    pattern: float | None
    usual: NDArray[np.float32]

    __repr__ = short_repr


def look_at_keyboard(light: LightRecord) -> KeyboardLook:
    """Compare the keys in every frame with white and black keys, and with their usual look.

    Args:
        light: colours of the keys in each frame, see `KeyLight`.
    """
    pattern: float | None = None
    usual = np.ones(len(light), np.float32)
    for zone in _ZONES:
        some = light.every(max(1, len(light) // _SOME_FRAMES), zone)
        level = np.median(some.mean(axis=2), axis=0)
        seen = level > 0  # what is outside the picture is read as 0
        if seen.sum() < _FEWEST or not np.ptp(level[seen]) > 0:
            continue
        parts = [
            _correlation(block.mean(axis=2)[:, seen], level[seen]) for block in light.blocks(zone)
        ]
        likeness = np.concatenate(parts).astype(np.float32)
        # A hand or light may change the look of one zone; where the camera moves, that of both.
        usual = likeness if pattern is None else np.maximum(usual, likeness)
        white = level / maximum_filter1d(level, _BESIDE, mode="nearest").clip(1)
        found = float(_correlation(white[None, seen], (~BLACK[seen]).astype(np.float64))[0])
        pattern = found if pattern is None else max(pattern, found)
    return KeyboardLook(pattern, usual)


def _correlation(rows: NDArray[np.floating], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T,) Correlation of each row (T, K) with another one (K,); 0 for a row without contrast."""
    rows = rows - rows.mean(axis=1, keepdims=True)
    other = other - other.mean()
    norm = np.linalg.norm(rows, axis=1) * np.linalg.norm(other)
    return np.asarray(rows @ other / np.where(norm > 0, norm, np.inf))
