"""Fixtures for all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference data, which a user's machine does not have."""
    beside = Path(__file__).parents[2] / "shared"
    folder = Path(os.environ.get("PIANOMIME_SHARED") or beside)
    if not folder.is_dir():
        pytest.skip("no reference data (PIANOMIME_SHARED names its folder)")
    return folder
