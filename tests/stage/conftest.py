from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import pianomime.stage.server
from pianomime.stage.server import Stage


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stage]:
    """A stage whose page may not be built."""
    monkeypatch.setattr(pianomime.stage.server, "page_script", lambda name: f"/* {name} */")
    with Stage(tmp_path / "out", []) as opened:
        yield opened
