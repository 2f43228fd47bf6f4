"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write a file in one step, so that a reader never finds half of it.

    Yields a temporary path in the same folder, with the same suffix (writers that choose a format
    by suffix, and those that add one they miss, work as they are). Leaving the block puts the file
    in place; any exception, Ctrl-C too, removes it and leaves what was at `path` untouched.

    Args:
        path: where the file should end up; its folder must exist.

    Raises:
        FileNotFoundError: the folder does not exist, or the block wrote nothing.
    """
    target = Path(path)
    # Our own empty folder rather than a name that is only likely to be free: the writer creates the
    # file itself, with the permissions that the user's umask gives, and two writers cannot meet.
    with tempfile.TemporaryDirectory(prefix=f".{target.stem}-", dir=target.parent) as folder:
        temporary = Path(folder, target.name)
        yield temporary
        os.replace(temporary, target)


def leftovers(folder: Path, names: Iterable[str]) -> list[str]:
    """Names of the folders in which `atomic` was writing files when its process was killed.

    Args:
        folder: where the files should have ended up.
        names: of the files.
    """
    ours = "|".join(re.escape(Path(name).stem) for name in names)
    form = re.compile(rf"\.({ours})-\w+")
    return [file.name for file in folder.iterdir() if form.fullmatch(file.name) and file.is_dir()]


def sweep(folder: Path, names: Iterable[str]) -> None:
    """Remove `leftovers`; nobody may be writing these files."""
    for name in leftovers(folder, names):
        shutil.rmtree(folder / name, ignore_errors=True)
