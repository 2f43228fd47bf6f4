"""Reading and writing .npz files, with errors in one line for files of another kind."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import Any, TypeVar
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError

_Made = TypeVar("_Made")

_BLOCK = 1 << 20
"""Bytes that are compressed at a time."""


def read_arrays(path: str | os.PathLike[str], kind: str) -> dict[str, NDArray[Any]]:
    """Read all arrays of a file.

    Args:
        path: the .npz file.
        kind: what it should be, such as "a performance".

    Raises:
        OSError: the file does not exist or cannot be read.
        InputError: it is not an .npz file, or damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return dict(file)
    except (FileNotFoundError, IsADirectoryError, PermissionError):
        raise
    except Exception as error:
        # On damaged data zipfile, zlib and numpy raise many kinds of errors, with messages such as
        # the advice to allow pickles, which do not help a user.
        raise InputError(f"{path}: not {kind}, or a damaged one") from error


def read_archive(
    path: str | os.PathLike[str],
    kind: str,
    version: tuple[str, int],
    make: Callable[[dict[str, NDArray[Any]]], _Made],
) -> _Made:
    """Read an object from a file with a version number.

    Args:
        path: the .npz file.
        kind: what it should be, such as "a performance".
        version: name of the array with the version, and the version that can be read.
        make: makes the object from the arrays.

    Raises:
        OSError: the file does not exist or cannot be read.
        InputError: it is of another kind, or of another version.
    """
    name, known = version
    arrays = read_arrays(path, kind)
    try:
        found = int(arrays[name])
        made = make(arrays) if found == known else None
    except Exception as error:  # arrays of another kind raise many kinds of errors
        raise InputError(f"{path}: not {kind}, or a damaged one") from error
    if made is None:
        raise InputError(
            f"{path}: {kind} of version {found}; this program reads version {known}: make it anew"
        )
    return made


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays to one compressed file, in small blocks: `numpy.savez` takes 40 MiB more.

    Args:
        path: the .npz file.
        arrays: arrays of numbers or texts, by name.

    Raises:
        OSError: the file cannot be written.
    """
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            array = np.asarray(array, order="C")
            content = array.reshape(-1).view(np.uint8)
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                header = np.lib.format.header_data_from_array_1_0(array)
                np.lib.format.write_array_header_1_0(file, header)
                for first in range(0, len(content), _BLOCK):
                    file.write(content[first : first + _BLOCK].data)
