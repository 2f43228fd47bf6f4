"""Notes that keys sound: made of their events, step after step."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.world.key_sensor import KeyEvents
from pianomime.world.parameters import PHYSICS_DT


class SoundingNotes:
    """Makes notes of what keys sense, frame after frame."""

    def __init__(self) -> None:
        self._notes: list[list[float]] = []  # key, on, off, speed
        self._last: dict[int, list[float]] = {}  # of each key

    def add(self, events: KeyEvents, begin: float) -> None:
        """Add the events of a frame, or a part of one, that begins at a time [s].

        The end of a note whose beginning was not added is left out.
        """
        for _, key, on, after, speed in zip(*map(np.ndarray.tolist, events), strict=True):
            if on:
                self._last[key] = [key, begin + after, math.inf, speed]
                self._notes.append(self._last[key])
            elif key in self._last:
                self._last[key][2] = begin + after

    def arrays(self, end: float) -> dict[str, NDArray[Any]]:
        """The `event_*` of a `Performance` that ends at a time [s], but for their velocities."""
        notes = np.array(sorted(self._notes, key=lambda note: note[1])).reshape(-1, 4)
        key, on, off, speed = notes.T
        # A key that sounds in the very last moment lasts a moment.
        return {
            "event_key": key.astype(np.int64),
            "event_on": on,
            "event_off": np.maximum(np.minimum(off, end), on + PHYSICS_DT),
            "event_speed": speed,
        }
