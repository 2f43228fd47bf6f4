"""`docs/make_replays.py`: the replays in the documentation are those of the code as it is."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

import made_up
from pianomime import Performance

SCRIPT = Path(__file__).parents[1] / "docs" / "make_replays.py"


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, which plays made-up songs into folders of the test, and tells in `played`."""
    spec = importlib.util.spec_from_file_location("make_replays", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    played: list[str] = []

    def play(song: str) -> Performance:
        played.append(song)
        return made_up.performance(made_up.score(notes=3, title=song))

    monkeypatch.setattr(module, "PLAYED", tmp_path / "played")
    monkeypatch.setattr(module, "SITE", tmp_path / "site")
    monkeypatch.setattr(module, "_play", play)
    monkeypatch.setattr(module, "write_gallery", lambda *_, **__: None)
    monkeypatch.setattr(module, "program_hash", lambda: "this code")
    monkeypatch.setattr(module, "played", played, raising=False)
    return module


def test_songs_are_played_again_when_the_code_has_changed(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    script.main()
    assert script.played == [*script.SONGS]
    (script.PLAYED / f"{script.SONGS[1]}.npz").unlink()
    script.main()
    assert script.played == [*script.SONGS, script.SONGS[1]]
    monkeypatch.setattr(script, "program_hash", lambda: "other code")
    script.main()
    assert script.played == [*script.SONGS, script.SONGS[1], *script.SONGS]
