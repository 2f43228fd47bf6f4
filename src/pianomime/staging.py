"""Hidden folders in which output is made: an output has one writer, and nothing is left behind.

The folder of an output depends on the output's name alone, and whoever works in it holds a lock,
which the operating system ends with the process, however that ends. So the next process that writes
there finds what a killed one left, and can tell it from what one that lives is writing.

Windows has no such locks: there each writer has a folder of its own, and none is swept.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import secrets
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from pianomime.errors import InputError
from pianomime.stop import deferred

_NAME = re.compile(r"\.pianomime-[0-9a-f]{16}")
"""Names of our folders."""
_LOCK, _INSIDE = "lock", "out"
"""What is in them: the file that is locked, and the folder that is worked in."""
_PATIENCE = 1.0
"""[s] for a process that was killed to be gone."""
_PAUSE = 0.02
"""[s] between tries."""


@contextlib.contextmanager
def claim(path: Path, patience: float = _PATIENCE) -> Iterator[Path]:
    """Hold an output, a file or a folder, as its only writer.

    Yields an empty folder on the same file system, which is removed at the end. What a killed
    process left of one for the same output is removed at the beginning.

    Args:
        path: of the output, which need not exist; the folder that it is in must.
        patience: how long to wait for another writer to be done [s].

    Raises:
        InputError: another process holds the output.
        FileNotFoundError: there is no folder for it.
        OSError: nothing can be written there.
    """
    # The same for every way to the same folder.
    absolute = Path(os.path.realpath(path) if path.is_dir() else os.path.abspath(path))
    folder = _home(absolute) / _folder_name(absolute)
    deadline = time.monotonic() + patience
    lock = None
    try:
        while True:
            # A signal must find either no folder or one that is cleared away below; but while
            # this waits for another writer, it stops at once.
            with deferred():
                lock = _taken(folder)
            if lock is not None:
                break
            if time.monotonic() > deadline:
                raise InputError(f"{path}: another process is writing it")
            time.sleep(_PAUSE)
        inside = folder / _INSIDE
        shutil.rmtree(inside, ignore_errors=True)
        # Not the folder itself, which only the user may read: this one has the umask's permissions.
        inside.mkdir()
        yield inside
    finally:
        if lock is not None:
            _removed(folder, lock)


@contextlib.contextmanager
def hold(path: Path, patience: float = _PATIENCE) -> Iterator[Path]:
    """`claim` for long work, which first removes all that killed processes left beside and in it.

    Args:
        path: of the output.
        patience: how long to wait for another writer to be done [s].

    Raises:
        InputError: another process holds the output.
        OSError: nothing can be written there.
    """
    sweep(path.parent)
    sweep(path)
    with claim(path, patience) as inside:
        yield inside


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """A folder for temporary files, which only this user may read; it is removed at the end.

    Those that killed processes left are removed at the beginning.
    """
    home = Path(tempfile.gettempdir())
    sweep(home)
    with claim(home / secrets.token_hex()) as folder:
        yield folder


def sweep(home: Path) -> None:
    """Remove from a folder what killed processes left in it; what is in use stays.

    Args:
        home: where outputs are, or should have been; it need not exist.
    """
    if sys.platform == "win32" or not home.is_dir():
        return
    for folder in _ours(home):
        # One of another user, or one that is gone meanwhile.
        with contextlib.suppress(OSError), deferred():
            lock = _taken(folder)
            if lock is not None:
                _removed(folder, lock)


def is_staging(name: str) -> bool:
    """Whether a file of this name is a hidden folder of ours."""
    return _NAME.fullmatch(name) is not None


def _ours(home: Path) -> Iterator[Path]:
    """Our hidden folders in a folder."""
    for folder in home.iterdir():
        if is_staging(folder.name) and folder.is_dir() and not folder.is_symlink():
            # Somebody else's of the same name would hold something else. In a folder of temporary
            # files there are those of other users.
            with contextlib.suppress(OSError):
                mine = folder.stat().st_uid == os.geteuid()
                if mine and {*os.listdir(folder)} <= {_LOCK, _INSIDE}:
                    yield folder


def _home(path: Path) -> Path:
    """Where the folder of an output is: beside it, or in it where it is a mount of its own."""
    beside = path.parent
    if path.is_dir():
        mounted = path.stat().st_dev != beside.stat().st_dev
        if mounted or not os.access(beside, os.W_OK | os.X_OK):
            return path
    return beside


def _folder_name(path: Path) -> str:
    if sys.platform == "win32":
        return f".pianomime-{secrets.token_hex(8)}"
    # A hash, for a name may be as long as names can be.
    return f".pianomime-{hashlib.sha256(os.fsencode(path.name)).hexdigest()[:16]}"


def _taken(folder: Path) -> int | None:
    """The lock of a folder, which is made if need be; None if another process has it.

    Where the file system has no locks, everybody gets it.
    """
    with contextlib.suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    path = folder / _LOCK
    try:
        lock = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    except FileNotFoundError:  # Whoever held it has just removed it.
        return None
    try:
        if sys.platform != "win32":
            import fcntl

            with contextlib.suppress(OSError):
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    os.close(lock)
                    return None
        # Whoever held it may have removed it since it was opened.
        if os.path.samestat(os.fstat(lock), path.stat()):
            return lock
    except FileNotFoundError:
        pass
    except BaseException:
        os.close(lock)
        raise
    os.close(lock)
    return None


def _removed(folder: Path, lock: int) -> None:
    """Remove a folder of ours while it is locked, then let go of it.

    A signal waits until that is done.
    """
    with deferred():
        try:
            shutil.rmtree(folder / _INSIDE, ignore_errors=True)
            if sys.platform == "win32":  # It cannot remove what is open.
                shutil.rmtree(folder, ignore_errors=True)
            else:
                with contextlib.suppress(OSError):
                    (folder / _LOCK).unlink()
                    folder.rmdir()
        finally:
            os.close(lock)
