"""Files appear whole or not at all."""

import os
import stat
from pathlib import Path

import pytest

from pianomime.files import atomic


def test_file_appears_at_the_end(tmp_path: Path) -> None:
    target = tmp_path / "song.tar.npz"
    with atomic(target) as temporary:
        assert temporary.suffix == ".npz"
        assert not temporary.exists()
        temporary.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new"
    assert os.listdir(tmp_path) == ["song.tar.npz"]
    plain = tmp_path / "plain"
    plain.write_text("")
    assert stat.S_IMODE(target.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_the_old_file(tmp_path: Path, error: type[BaseException]) -> None:
    target = tmp_path / "song.mid"
    target.write_text("old")

    def fail() -> None:
        with atomic(target) as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(error):
        fail()
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["song.mid"]


def test_writing_nothing_or_nowhere_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic(tmp_path / "song.mid"):
        pass
    with pytest.raises(FileNotFoundError), atomic(tmp_path / "no" / "song.mid"):
        pass
    assert os.listdir(tmp_path) == []
