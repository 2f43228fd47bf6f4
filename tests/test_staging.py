"""Hidden folders: an output has one writer, and what a killed one left goes, but nothing else."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from pianomime.errors import InputError
from pianomime.staging import claim, hold, is_staging, scratch, sweep
from pianomime.stop import Stopped, stoppable

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such locks")

_WRITER = """
import sys, time
from pathlib import Path
from pianomime.staging import hold
with hold(Path(sys.argv[1])) as folder:
    (folder / "half").write_text("half of it")
    print("writing", flush=True)
    time.sleep(600)
"""


@contextmanager
def writer(out: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that is writing an output."""
    process = subprocess.Popen(
        [sys.executable, "-c", _WRITER, str(out)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "writing\n"
        yield process
    finally:
        process.kill()
        process.communicate()


def _hidden(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if is_staging(path.name)]


def test_a_second_writer_is_refused_in_one_line_and_disturbs_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with writer(out):
        with pytest.raises(InputError) as refused, hold(out, 0.0):
            pass
        assert str(refused.value) == f"{out}: another process is writing it"
        (folder,) = _hidden(tmp_path)
        assert (folder / "out" / "half").read_text() == "half of it"
        with hold(tmp_path / "another"):  # Whose sweep passes by.
            assert len(_hidden(tmp_path)) == 2
        assert _hidden(tmp_path) == [folder]


def test_every_way_to_a_folder_leads_to_one_writer(tmp_path: Path) -> None:
    out, other = tmp_path / "out", tmp_path / "link"
    out.mkdir()
    other.symlink_to(out)
    with claim(out), pytest.raises(InputError, match="another process"), claim(other, 0.0):
        pass


def test_what_a_killed_writer_left_is_removed_by_the_next(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with writer(out) as killed:
        killed.send_signal(signal.SIGKILL)
        killed.wait()
    assert len(_hidden(tmp_path)) == 1
    with hold(tmp_path / "another"):
        assert len(_hidden(tmp_path)) == 1  # Its own.
    assert _hidden(tmp_path) == []
    with hold(out) as folder:
        assert [*folder.iterdir()] == []


def test_only_dead_folders_of_ours_are_swept(tmp_path: Path) -> None:
    name = ".pianomime-" + 16 * "0"
    elsewhere = tmp_path / "elsewhere"
    for kept in (elsewhere, tmp_path / name, tmp_path / ".pianomime-config", tmp_path / ".hidden"):
        kept.mkdir()
        (kept / "precious").write_text("kept")
    (tmp_path / f"{name[:-1]}1").symlink_to(elsewhere)
    (tmp_path / f"{name[:-1]}2").write_text("a file")
    before = {*tmp_path.rglob("*")}
    dead = tmp_path / f"{name[:-1]}3"
    (dead / "out" / "deep").mkdir(parents=True)
    (dead / "lock").touch()
    # Killed between making the folder and making its lock.
    (tmp_path / f"{name[:-1]}4").mkdir()
    sweep(tmp_path)
    assert {*tmp_path.rglob("*")} == before
    sweep(tmp_path / "nowhere")


@pytest.mark.parametrize("error", [KeyboardInterrupt, InputError])
def test_nothing_is_left_of_a_writer_that_fails(
    error: type[BaseException], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def fail() -> None:
        with hold(tmp_path / "out") as folder, scratch() as temporary:
            (folder / "a").touch()
            (temporary / "b").touch()
            raise error

    with pytest.raises(error):
        fail()
    assert [*tmp_path.iterdir()] == []


def _signalling(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function during which SIGTERM arrives, the first time."""
    times = iter([signal.SIGTERM])

    def call(*arguments: Any, **named: Any) -> Any:
        for number in times:
            signal.raise_signal(number)
        return function(*arguments, **named)

    return call


@pytest.mark.parametrize(
    ("owner", "name"),
    [(os, "open"), (os.path, "samestat"), (shutil, "rmtree"), (Path, "unlink"), (Path, "rmdir")],
)
def test_nothing_is_left_by_a_signal_while_a_folder_is_taken_or_removed(
    owner: Any, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    received: list[int] = []
    with stoppable(received), monkeypatch.context() as patched:
        patched.setattr(owner, name, _signalling(getattr(owner, name)))
        with pytest.raises(Stopped), claim(tmp_path / "out") as folder:
            (folder / "half").touch()
    assert received == [signal.SIGTERM]
    assert [*tmp_path.iterdir()] == []


def test_a_sweep_that_is_stopped_leaves_no_folder_half_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dead = tmp_path / (".pianomime-" + 16 * "0")
    (dead / "out" / "deep").mkdir(parents=True)
    with stoppable([]), monkeypatch.context() as patched:
        patched.setattr(shutil, "rmtree", _signalling(shutil.rmtree))
        with pytest.raises(Stopped):
            sweep(tmp_path)
    assert [*tmp_path.iterdir()] == []


def test_who_waits_for_another_writer_is_stopped_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    with writer(out), stoppable([]):
        monkeypatch.setattr(time, "sleep", _signalling(time.sleep))
        with pytest.raises(Stopped), claim(out, 60.0):
            pass
        (folder,) = _hidden(tmp_path)
        assert (folder / "out" / "half").exists()


def test_temporary_files_are_private_and_each_has_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with scratch() as one, scratch() as other:
        assert one != other
        assert one.parent.stat().st_mode & 0o077 == 0
        assert os.access(one, os.W_OK)
    assert [*tmp_path.iterdir()] == []
