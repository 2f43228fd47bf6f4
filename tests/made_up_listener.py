"""Recordings that are made up, and a listener who hears what it was told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pianomime.music import Score, write_wav
from pianomime.music.sound import SAMPLE_RATE

RATE = 1000
"""[Hz] Rate at which the listener hears: enough for one that does not listen."""
_BASE, _RISE = 0.1, 0.8 / 3600
"""First sample of a ramp, and its rise in a second."""


@dataclass
class Teller:
    """Says that the notes of a score are heard, whatever the sound.

    Attributes:
        score: what it says.
        ramp: whether the sound is a `ramp`, and says when a stretch begins; else it is one stretch.
        lengths: of the stretches that it was given [s].
    """

    score: Score
    ramp: bool = False
    rate: int = RATE
    lengths: list[float] = field(default_factory=list)

    def hear(self, samples: NDArray[np.float32], heard: Callable[[float], None]) -> Score:
        seconds = len(samples) / self.rate
        self.lengths.append(seconds)
        heard(seconds / 2)
        heard(seconds)
        score = self.score
        # Stretches begin at even seconds, and 16 bits tell these apart.
        begin = round(float(samples[0] - _BASE) / _RISE / 2) * 2.0 if self.ramp else 0.0
        note, foot = (
            (onset >= begin) & (onset < begin + seconds)
            for onset in (score.onset, score.pedal[:, 0])
        )
        return replace(
            score,
            key=score.key[note],
            onset=score.onset[note] - begin,
            offset=score.offset[note] - begin,
            velocity=score.velocity[note],
            pedal=score.pedal[foot] - begin,
        )


def ramp(path: Path, seconds: float) -> Path:
    """A WAV file whose samples say what time it is."""
    write_wav(path, (_BASE + _RISE * np.arange(round(seconds * RATE)) / RATE)[:, None], RATE)
    return path


def tone(path: Path, seconds: float = 3.0, loud: float = 0.3) -> Path:
    """A WAV file of a steady tone."""
    times = np.arange(round(seconds * SAMPLE_RATE)) / SAMPLE_RATE
    write_wav(path, loud * np.sin(2 * np.pi * 440 * times)[:, None])
    return path
