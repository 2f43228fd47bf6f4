"""Names of files that are made from titles."""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from odd_names import texts
from pianomime.errors import InputError
from pianomime.file_names import LONGEST_NAME, check_name, file_name, file_names
from pianomime.files import staged
from pianomime.shown import shown


@given(texts)
def test_any_title_makes_a_name_of_one_visible_file(title: str) -> None:
    name = file_name(title)
    assert name.strip(" .")
    assert not name.startswith((".", " "))
    assert not name.endswith((".", " "))
    assert 0 < len(name.encode()) <= LONGEST_NAME
    assert shown(name) == name
    for kind in (PurePosixPath, PureWindowsPath):
        assert kind("out", name).parts == ("out", name)
        assert kind("out", f"{name}.json").stem == name
    assert not set('<>:"/\\|?*') & set(name)
    assert not PureWindowsPath(name).is_reserved()
    assert not PureWindowsPath(f"{name}.json").is_reserved()
    assert file_name(name) == name


@given(texts, texts)
def test_different_titles_have_different_names(one: str, other: str) -> None:
    assert (file_name(one) == file_name(other)) == (one == other)


@pytest.mark.parametrize("title", ["fur-elise", "Für Elise", "Song [piano]", "op. 9", "月光", "_"])
def test_plain_titles_are_their_own_names(title: str) -> None:
    assert file_name(title) == title


@pytest.mark.parametrize("device", ["CON", "nul", "Aux.txt", "COM1", "lpt9.tar.gz"])
def test_devices_of_windows_are_no_names(device: str) -> None:
    assert file_name(device) != device


_PARTS = st.sampled_from(["a", "b", "a-b", "b.mid", "..", "a\udce9", "x" * 200])


@given(
    st.lists(
        st.builds(
            lambda folders, name, suffix: Path(*folders, name + suffix),
            st.lists(st.sampled_from(["a", "b", "a-b", "x" * 200]), max_size=2),
            _PARTS,
            st.sampled_from([".mid", ".midi", ".npz"]),
        ),
        unique=True,
        max_size=12,
    )
)
def test_files_of_many_folders_never_share_a_name(paths: list[Path]) -> None:
    names = file_names(paths)
    assert len(names) == len(set(names)) == len(paths)
    assert all(file_name(name) == name for name in names)


def test_only_names_that_meet_become_longer() -> None:
    paths = [Path("c.mid"), Path("d", "c.mid"), Path("a-b.mid"), Path("a-b.npz"), Path("a/b.mid")]
    names = file_names(paths)
    assert names[:2] == ["c", "d-c"]
    assert names[3] == "a-b.npz"
    assert all(name.startswith("a-b.mid-") or name.startswith("a-b.mid") for name in names[2::2])


def test_a_name_that_no_file_system_takes_is_refused_before_the_work(tmp_path: Path) -> None:
    check_name(tmp_path / ("x" * 255))
    with pytest.raises(InputError, match="longer than 255 bytes"):
        check_name(tmp_path / ("é" * 128))
    for out, name in ((tmp_path / ("x" * 256), "a"), (tmp_path / "out", "x" * 256)):
        with pytest.raises(InputError, match="longer than 255 bytes"), staged(out, (name,)):
            raise AssertionError("the work has begun")
    assert not list(tmp_path.iterdir())
