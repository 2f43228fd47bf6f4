"""Memory of planning: what a minute more of music takes."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from pianomime.keyboard import NO_KEY
from pianomime.plan.hand_path import HandPathConfig, hand_paths
from pianomime.plan.joint_path import PathConfig


def test_a_minute_more_of_hand_paths_takes_little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_WINDOW", "_SOLVED"):
        monkeypatch.setattr(f"pianomime.plan.joint_path.{name}", 100)
    config = HandPathConfig(PathConfig(iterations=2))
    peaks = []
    frames = 400, 1600
    for count in frames:
        finger_key = np.full((count, 2, 5), NO_KEY, np.int8)
        finger_key[5::40, :, 2] = 40
        tracemalloc.start()
        hand_paths(finger_key, config)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # Of these 3 kB are the lower triangle of a block of its matrix. The whole matrix in bands would
    # take 12 kB, and LAPACK a copy.
    assert (peaks[1] - peaks[0]) / (frames[1] - frames[0]) < 8e3
