from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime import load_player
from pianomime.music import Score
from pianomime.songs.find import find_song


@pytest.fixture(scope="session")
def song_controls() -> NDArray[np.float64]:
    """(T, 46) controls with which the hands really play: 8 s of a bundled song."""
    score = Score.from_midi(find_song("bach-prelude-c")).clip(0.0, 8.0)
    return load_player("zero-shot-20hz").play(score).ctrl[:, 0]
