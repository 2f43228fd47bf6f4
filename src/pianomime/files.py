"""Atomic writing: files, and folders of files, that appear completely or not at all."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from pianomime.errors import InputError
from pianomime.file_names import check_name, check_replaceable
from pianomime.staging import claim, hold
from pianomime.stop import deferred

_PATIENCE = 10.0
"""[s] for another writer of the same file to be done."""


@contextmanager
def atomic(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write a file in one step, so that a reader never finds half of it.

    Yields a temporary path in the same folder, with the same suffix, because some writers choose a
    format by it. Leaving the block moves the file into place; any exception, Ctrl-C too, removes
    it and leaves what was at `path` untouched. Of several writers each waits for the one before.

    Args:
        path: where the file should end up; its folder must exist.

    Raises:
        FileNotFoundError: the folder does not exist, or the block wrote nothing.
        InputError: another process does not come to an end with the same file.
    """
    target = Path(path)
    # A temporary folder, not a temporary file name: the writer creates the file itself, with the
    # permissions of the user's umask.
    with claim(target, _PATIENCE) as folder:
        temporary = folder / target.name
        yield temporary
        os.replace(temporary, target)


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
def staged(out: Path, ours: Collection[str], name: str | None = None) -> Iterator[Path]:
    """Collect files in a temporary folder, then put them in place together.

    Yields the temporary folder. Any exception in the block, Ctrl-C too, removes its files and
    leaves `out` as it was. Leaving the block moves them into `out`: in one step if `out` does not
    exist, else one by one, so that an interruption during the move leaves some of them in place.
    Nobody else writes there meanwhile, and what killed processes left there is removed.

    Args:
        out: where the files should end up; created, with its parents, if it does not exist.
        ours: all names that a caller may write: files of these names in `out` that were not
            written this time are from an earlier run and are removed. No other file in `out` is
            touched.
        name: of the one output in `out` that is written, if others may be written meanwhile.

    Raises:
        InputError: `out` is not a folder, cannot be written, or another process writes there.
    """
    for name_inside in ours:
        check_name(out / name_inside)
    check_name(out)
    real = Path(os.path.realpath(out))
    with ExitStack() as stack:
        try:
            stack.enter_context(_folders(real.parent if name is None else real, out))
            temporary = stack.enter_context(hold(out if name is None else out / name))
        except OSError as error:
            raise _cannot_be_written(out, error) from error
        yield temporary
        try:
            _move(temporary, real, ours)
        except OSError as error:
            raise _cannot_be_written(out, error) from error


@contextmanager
def new_folder(path: Path, is_ours: Callable[[Path], bool], kind: str) -> Iterator[Path]:
    """Write a folder all or nothing; an older one of the same kind at its place is replaced.

    Yields where to write, at which there is nothing yet. Any exception in the block, Ctrl-C too,
    removes what was written and leaves the older one as it was.

    Args:
        path: where the folder should end up; the folder that it is in must exist.
        is_ours: whether the folder at a path may be replaced.
        kind: what is replaced, such as "a data set".

    Raises:
        InputError: there is something else at the place, it has no name, or another process writes
            there.
        OSError: it cannot be written.
    """
    path = _place(path)
    with hold(path) as folder:
        # Not in the folder, which the next process sweeps: for a moment it is the only one.
        older = _aside(path)
        _undo(older, path)
        if path.exists() and not is_ours(path):
            raise InputError(f"{path}: is something else than {kind}")
        fresh = Path(folder, path.name)
        yield fresh
        # A signal waits: nobody shall find neither of the two.
        with deferred():
            if path.exists():
                os.replace(path, older)
            try:
                os.replace(fresh, path)
            except BaseException:
                _undo(older, path)
                raise
            if older.exists():
                # To be removed with the folder: what stays aside would be put back.
                os.replace(older, folder / "older")


def put_back(path: Path) -> None:
    """Put back the folder that `new_folder` had set aside when its process was killed, if any.

    For whoever reads what is at a place before replacing it.

    Args:
        path: where the folder was.

    Raises:
        InputError: it has no name, or another process writes there.
        OSError: it cannot be moved.
    """
    path = _place(path)
    older = _aside(path)
    if older.exists():
        with hold(path):
            _undo(older, path)


def _place(path: Path) -> Path:
    """Where a folder that is replaced as a whole really is.

    Raises:
        InputError: it has no name.
    """
    check_replaceable(path)
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def _aside(path: Path) -> Path:
    """Where a folder is while another takes its place: a hash, for names may be long."""
    digest = hashlib.sha256(os.fsencode(path.name)).hexdigest()[:16]
    return path.with_name(f".pianomime-older-{digest}")


def _undo(older: Path, path: Path) -> None:
    """Put a folder back that was set aside; if the new one is in its place, it is not needed."""
    if not older.exists():
        return
    if path.exists():
        shutil.rmtree(older)
    else:
        os.replace(older, path)


@contextmanager
def _folders(path: Path, out: Path) -> Iterator[None]:
    """Make a folder and those that it is in; those that stay empty are removed again."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; a folder is needed")
    missing = []
    while not path.exists():
        missing.append(path)
        path = path.parent
    if not path.is_dir():
        raise InputError(f"{path}: is a file; a folder is needed")
    try:
        for folder in reversed(missing):
            folder.mkdir(exist_ok=True)
        yield
    finally:
        for folder in missing:
            with suppress(OSError):  # It holds something.
                folder.rmdir()


def _move(temporary: Path, out: Path, ours: Collection[str]) -> None:
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
