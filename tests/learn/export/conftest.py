from __future__ import annotations

from pathlib import Path

import pytest

from pianomime.learn.data.trajectories import TrajectoryData


@pytest.fixture(scope="module")
def data(path: Path) -> TrajectoryData:
    """The data set that a module makes at `path`."""
    return TrajectoryData.open(path)
