"""Atomic writing: files, and folders of files, that appear completely or not at all."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from pianomime.errors import InputError


@contextmanager
def atomic(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write a file in one step, so that a reader never finds half of it.

    Yields a temporary path in the same folder, with the same suffix, because some writers choose a
    format by it. Leaving the block moves the file into place; any exception, Ctrl-C too, removes
    it and leaves what was at `path` untouched.

    Args:
        path: where the file should end up; its folder must exist.

    Raises:
        FileNotFoundError: the folder does not exist, or the block wrote nothing.
    """
    target = Path(path)
    # A temporary folder, not a temporary file name: the writer creates the file itself, with the
    # permissions of the user's umask, and two writers cannot choose the same name.
    with tempfile.TemporaryDirectory(prefix=f".{target.stem}-", dir=target.parent) as folder:
        temporary = Path(folder, target.name)
        yield temporary
        os.replace(temporary, target)


def leftovers(folder: Path, names: Iterable[str]) -> list[str]:
    """Names of temporary folders that `atomic` left when its process was killed.

    Args:
        folder: where the files should have ended up.
        names: names of the files.
    """
    ours = "|".join(re.escape(Path(name).stem) for name in names)
    form = re.compile(rf"\.({ours})-\w+")
    return [file.name for file in folder.iterdir() if form.fullmatch(file.name) and file.is_dir()]


def sweep(folder: Path, names: Iterable[str]) -> None:
    """Remove the temporary folders that `leftovers` finds.

    Args:
        folder: where the files should have ended up.
        names: names of the files, which nobody may be writing now.
    """
    for name in leftovers(folder, names):
        shutil.rmtree(folder / name, ignore_errors=True)


def files_digest(files: Iterable[Path]) -> str:
    """SHA-256 of the contents of files, one after the other, in hexadecimal digits.

    Raises:
        OSError: one cannot be read.
    """
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()


@contextmanager
def staged(out: Path, ours: Collection[str]) -> Iterator[Path]:
    """Collect files in a temporary folder, then put them in place together.

    Yields the temporary folder. Any exception in the block, Ctrl-C too, removes its files and
    leaves `out` as it was. Leaving the block moves them into `out`: in one step if `out` does not
    exist, else one by one, so that an interruption during the move leaves some of them in place.

    Args:
        out: where the files should end up; created, with its parents, if it does not exist.
        ours: all names that a caller may write: files of these names in `out` that were not
            written this time are from an earlier run and are removed. No other file in `out` is
            touched.

    Raises:
        InputError: `out` is not a folder, or cannot be written.
    """
    try:
        mine = _folder_beside(out)
    except OSError as error:
        raise _cannot_be_written(out, error) from error
    try:
        # Not `mine` itself, which only the user may read: this one has the umask's permissions.
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
    """A new folder on the same file system as `out`, which may be a mount of its own."""
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
