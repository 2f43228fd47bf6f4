"""Scores for tests of planning: a few simple ones, and any whatever."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from pianomime.music import Score

FRAME = 0.05


def score_of(*notes: tuple[int, int, int]) -> Score:
    """Notes as (key, first frame, end)."""
    key, first, end = (np.array(column, int) for column in zip(*notes, strict=True))
    return Score(key, first * FRAME, end * FRAME, np.full(len(key), 80))


def chord(keys: list[int], first: int = 4, end: int = 8) -> Score:
    return score_of(*((key, first, end) for key in keys))


def melody(keys: list[int], frames: int = 5) -> Score:
    """One note after the other."""
    return score_of(
        *((key, 4 + place * frames, 3 + (place + 1) * frames) for place, key in enumerate(keys))
    )


@st.composite
def scores(draw: st.DrawFn, most_notes: int = 25, seconds: float = 1.0) -> Score:
    """Anything: chords, notes again on a sounding key, the outermost keys, no length at all.

    Notes begin within so many seconds, and last no longer than that.
    """
    time = st.integers(0, int(seconds * 64)).map(lambda n: n / 64)
    low = draw(st.integers(0, 87))
    width = draw(st.integers(1, 88))
    notes = draw(
        st.lists(
            st.tuples(
                st.integers(0, width - 1).map(lambda step: min(low + step, 87)),
                st.one_of(time, st.sampled_from([0.0, 0.5])),
                st.one_of(st.just(0.0), time),
            ),
            min_size=1,
            max_size=most_notes,
        )
    )
    key, onset, length = (np.array(column) for column in zip(*notes, strict=True))
    pedal = draw(st.lists(time.map(lambda on: (on, on + 0.3)), max_size=2))
    return Score(key, onset, onset + length, np.full(len(key), 80), np.array(pedal))
