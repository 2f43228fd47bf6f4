"""Excerpts: the part of a score that is played."""

from __future__ import annotations

import math

from pianomime.errors import InputError
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.music.score import Score


def excerpt(score: Score, start: float = 0.0, seconds: float = EXCERPT_SECONDS) -> Score:
    """Cut out a part of a score that begins with the first sound at or after `start`.

    Leading silence is left out, as in the paper's protocol, so that it neither costs time nor
    counts as perfect playing.

    Args:
        score: the whole song.
        start: where to begin [s]; notes that sound at that time are part of the excerpt.
        seconds: greatest length of the excerpt [s]; may be infinite.

    Raises:
        InputError: a time is out of range, or nothing sounds after `start`.
    """
    if not seconds > 0:
        raise InputError(f"seconds must be more than 0, not {seconds:g}")
    if not 0 <= start < math.inf:
        raise InputError(f"start must be 0 or more, not {start:g}")
    if start and start >= score.duration:
        raise InputError(
            f"nothing to play from {start:g} s on: {score.title} lasts {score.duration:.1f} s"
        )
    return score.clip(start, math.inf).trim_silence().clip(0.0, seconds)
