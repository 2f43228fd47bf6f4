"""A folder of results that appears whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from pianomime.errors import InputError


@contextmanager
def staged(out: Path, ours: Collection[str]) -> Iterator[Path]:
    """Collect files in a temporary folder, then put them in place together.

    Yields the temporary folder. Leaving the block moves its files into `out`; any exception,
    Ctrl-C too, removes them and leaves `out` as it was.

    Args:
        out: where the files should end up; made, with its parents, if need be.
        ours: names that belong to us: those in `out` that were not written this time are from
            an earlier run and are removed. No other file in `out` is touched.

    Raises:
        InputError: `out` is no folder.
        OSError: `out` cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; a folder is needed")
    # The temporary folder has to be on the file system of `out`, which may be a mount of its own.
    home = out.absolute()
    while not home.exists():
        home = home.parent
    if not home.is_dir():
        raise InputError(f"{home}: is a file; a folder is needed")
    temporary = home / f".pianomime-{os.getpid()}"
    try:
        temporary.mkdir()
        yield temporary
        out.parent.mkdir(parents=True, exist_ok=True)
        if not out.exists():
            temporary.rename(out)
            return
        written = {file.name for file in temporary.iterdir()}
        for name in written:
            os.replace(temporary / name, out / name)
        for name in set(ours) - written:
            (out / name).unlink(missing_ok=True)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
