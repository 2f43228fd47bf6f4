"""Excerpts: the part of a score that is played."""

from __future__ import annotations

import math

from pianomime.errors import InputError
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.music.score import MAX_SECONDS, Score


def excerpt(
    score: Score,
    start: float = 0.0,
    seconds: float = EXCERPT_SECONDS,
    lead_in: float = 0.0,
) -> Score:
    """Cut out a part of a score that begins with the first sound at or after `start`.

    Leading silence is left out, as in the paper's protocol, so that it neither costs time nor
    counts as perfect playing. A lead-in gives the hands time to get to their first keys.

    Args:
        score: the whole song.
        start: where to begin [s]; notes that sound at that time are part of the excerpt.
        seconds: greatest length of the music [s], without the lead-in; may be infinite.
        lead_in: silence before the first sound [s].

    Raises:
        InputError: a time is out of range, or nothing sounds after `start`.
    """
    check_part(start, seconds)
    if start and start >= score.duration:
        raise InputError(
            f"nothing to play from {start:g} s on: {score.title} lasts {score.duration:.1f} s"
        )
    check_lead_in(lead_in)
    return score.clip(start, math.inf).trim_silence().clip(0.0, seconds).delay(lead_in)


def check_part(start: float, seconds: float) -> None:
    """Refuse what is no part of any song.

    Args:
        start: where it begins [s].
        seconds: its greatest length [s].

    Raises:
        InputError: a time is out of range.
    """
    if not seconds > 0:
        raise InputError(f"seconds must be more than 0, not {seconds:g}")
    if not 0 <= start < math.inf:
        raise InputError(f"start must be 0 or more, not {start:g}")


def check_lead_in(lead_in: float) -> None:
    """Refuse what is no lead-in.

    Args:
        lead_in: silence before the first sound [s].

    Raises:
        InputError: it is negative, no number, or longer than a score can be.
    """
    if not 0 <= lead_in <= MAX_SECONDS:
        raise InputError(f"lead-in must be 0 to {MAX_SECONDS:g} s, not {lead_in:g}")
