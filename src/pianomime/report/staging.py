"""A folder of results whose files appear together, when all of them are complete."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from pianomime.errors import InputError


@contextmanager
def staged(out: Path, ours: Collection[str]) -> Iterator[Path]:
    """Collect files in a temporary folder, then put them in place together.

    Yields the temporary folder. Any exception in the block, Ctrl-C too, removes its files and
    leaves `out` as it was. Leaving the block moves them into `out`: in one step if there is no
    `out` yet, else one by one, so that what interrupts just that leaves some of them in place.

    Args:
        out: where the files should end up; made, with its parents, if need be.
        ours: names that belong to us: those in `out` that were not written this time are from
            an earlier run and are removed. No other file in `out` is touched.

    Raises:
        InputError: `out` is no folder, or cannot be written.
    """
    try:
        mine = _folder_beside(out)
    except OSError as error:
        raise _cannot_be_written(out, error) from error
    try:
        # Not `mine` itself, which nobody else may read: this one has the permissions of the umask.
        temporary = mine / "out"
        temporary.mkdir()
        yield temporary
        try:
            _move(temporary, out, ours)
        except OSError as error:
            raise _cannot_be_written(out, error) from error
    finally:
        shutil.rmtree(mine, ignore_errors=True)


def _folder_beside(out: Path) -> Path:
    """A new folder on the file system of `out`, which may be a mount of its own."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; a folder is needed")
    home = out.absolute()
    while not home.exists():
        home = home.parent
    if not home.is_dir():
        raise InputError(f"{home}: is a file; a folder is needed")
    return Path(tempfile.mkdtemp(prefix=".pianomime-", dir=home))


def _move(temporary: Path, out: Path, ours: Collection[str]) -> None:
    out.parent.mkdir(parents=True, exist_ok=True)
    if not out.exists():
        temporary.rename(out)
        return
    written = {file.name for file in temporary.iterdir()}
    for name in written:
        os.replace(temporary / name, out / name)
    for name in set(ours) - written:
        (out / name).unlink(missing_ok=True)


def _cannot_be_written(out: Path, error: OSError) -> InputError:
    return InputError(f"{out}: cannot be written: {error.strerror or error}")
