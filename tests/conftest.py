"""Fixtures for all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

# Tests run side by side: threads of one that wait for each other would keep cores from the others.
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference data, which a user's machine does not have."""
    beside = Path(__file__).parents[2] / "shared"
    folder = Path(os.environ.get("PIANOMIME_SHARED") or beside)
    if not folder.is_dir():
        pytest.skip("no reference data (PIANOMIME_SHARED names its folder)")
    return folder
