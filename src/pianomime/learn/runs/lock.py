"""A lock on the folder of a run, so that one process at a time trains in it."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

from pianomime.errors import InputError

_PATIENCE = 10.0
"""[s] for a process that was stopped, or whose node is lost, to be gone."""
_PAUSE = 0.1
"""[s] between tries."""


@contextlib.contextmanager
def run_lock(path: Path, patience: float = _PATIENCE) -> Iterator[None]:
    """Hold a run's folder, which is made where it is not there yet.

    The lock ends with the process that holds it, however that ends. Where the file system has no
    locks, or the operating system none of this kind, there is none.

    Args:
        path: of the folder.
        patience: how long to wait for another process to be done with it [s].

    Raises:
        InputError: there is a file at the place, or another process holds it.
        OSError: the folder cannot be made.
    """
    if path.is_file():
        raise InputError(f"{path}: is a file; a folder is needed")
    path.mkdir(parents=True, exist_ok=True)
    try:
        import fcntl
    except ModuleNotFoundError:  # Windows
        yield
        return
    # The folder itself is what is locked: there is no file to be left behind.
    folder = os.open(path, os.O_RDONLY)
    try:
        deadline = time.monotonic() + patience
        while True:
            try:
                fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise InputError(f"{path}: another process trains in this folder") from None
                time.sleep(_PAUSE)
            except OSError:
                break
        yield
    finally:
        os.close(folder)
