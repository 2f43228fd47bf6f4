"""Reading and writing .npz files: checked against a schema, and by the seal that they hold."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import IO, Any, TypeVar
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.schema import Field, check_names
from pianomime.seal import SEAL, seal_of

_Made = TypeVar("_Made")

_BLOCK = 1 << 20
"""Bytes that are compressed at a time."""
_SEAL = Field("text", optional=True)


def read_arrays(
    path: str | os.PathLike[str], kind: str, schema: Mapping[str, Field]
) -> dict[str, NDArray[Any]]:
    """Read those arrays of a file of others that are in a schema; it may hold more, and no seal.

    Args:
        path: the .npz file.
        kind: what it should be, such as "a performance".
        schema: of the arrays.

    Raises:
        OSError: the file does not exist or cannot be read.
        InputError: it is not such a file, or damaged: an array is missing, of another type or
            shape, or out of range.
    """
    try:
        arrays = _read(path, schema, more=True)
        _check_values(arrays, schema)
    except Exception as error:
        raise _refusal(path, kind, error) from error
    return arrays


def read_archive(
    path: str | os.PathLike[str],
    kind: str,
    version: tuple[str, int],
    schema: Mapping[str, Field],
    make: Callable[[dict[str, NDArray[Any]]], _Made],
) -> _Made:
    """Read an object from a file with a version number and a seal.

    Args:
        path: the .npz file.
        kind: what it should be, such as "a performance".
        version: name of the array with the version, and the version that can be read.
        schema: of all other arrays.
        make: makes the object from these.

    Raises:
        OSError: the file does not exist or cannot be read.
        InputError: it is of another kind, of another version, or damaged.
    """
    name, known = version
    number = Field("int", least=0)
    try:
        found = int(_read(path, {name: number}, more=True)[name])
        if found == known:
            arrays = _read(path, {name: number, **schema, SEAL: _SEAL})
            if str(arrays.pop(SEAL, "")) != seal_of(arrays):
                raise InputError("it was changed since it was written")
            del arrays[name]
            _check_values(arrays, schema)
            return make(arrays)
    except Exception as error:
        raise _refusal(path, kind, error) from error
    raise InputError(
        f"{path}: {kind} of version {found}; this program reads version {known}: make it anew"
    )


def holds(path: str | os.PathLike[str], name: str) -> bool:
    """Whether a file is one of arrays, among them one of a name; nothing else of it is read."""
    try:
        with ZipFile(path) as archive:
            return f"{name}.npy" in archive.namelist()
    except Exception:  # zipfile raises many kinds of errors on damaged files
        return False


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays and their seal to one compressed file.

    In small blocks: `numpy.savez` takes 40 MiB more.

    Args:
        path: the .npz file.
        arrays: arrays of numbers or texts, by name.

    Raises:
        OSError: the file cannot be written.
    """
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for name, array in {**arrays, SEAL: np.array(seal_of(arrays))}.items():
            array = np.asarray(array, order="C")
            content = array.reshape(-1).view(np.uint8)
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                header = np.lib.format.header_data_from_array_1_0(array)
                np.lib.format.write_array_header_1_0(file, header)
                for first in range(0, len(content), _BLOCK):
                    file.write(content[first : first + _BLOCK].data)


def _read(
    path: str | os.PathLike[str], schema: Mapping[str, Field], more: bool = False
) -> dict[str, NDArray[Any]]:
    """Read the arrays of a schema, none before its type and shape are checked.

    Args:
        path: the file.
        schema: of the arrays.
        more: whether there may be others, which are not read.
    """
    arrays: dict[str, NDArray[Any]] = {}
    sizes: dict[str, int] = {}
    with ZipFile(path) as archive:
        members = {each.filename.removesuffix(".npy"): each for each in archive.infolist()}
        check_names([each.removesuffix(".npy") for each in archive.namelist()], schema, more)
        for member in members.values():
            # A damaged name is found by its copy: the array that it should be may be optional.
            archive.open(member).close()
            if member.comment:  # which damage has made of the names of the next arrays
                raise InputError("its list of arrays is damaged")
        for name in [name for name in schema if name in members]:
            with archive.open(members[name]) as file:
                dtype, shape, first = _layout(file)
            schema[name].check_layout(name, dtype, shape, sizes)
            # Before memory is taken for what may be declared alone.
            if (
                members[name].file_size
                != first + int(np.prod(shape, dtype=object)) * dtype.itemsize
            ):
                raise InputError(f"{name} is not as long as it says")
            with archive.open(members[name]) as file:
                arrays[name] = np.lib.format.read_array(file, allow_pickle=False)
                # The checksum is compared at the end of the member.
                file.read(1)
    return arrays


def _layout(file: IO[bytes]) -> tuple[np.dtype[Any], tuple[int, ...], int]:
    """Type and shape of the array in an .npy file, and the place of its first byte."""
    major, _ = np.lib.format.read_magic(file)
    read = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}
    shape, _, dtype = read[major](file)
    if min(shape, default=0) < 0:
        raise InputError("a size is negative")
    return dtype, shape, file.tell()


def _check_values(arrays: Mapping[str, NDArray[Any]], schema: Mapping[str, Field]) -> None:
    for name, array in arrays.items():
        schema[name].check_values(name, array)


def _refusal(path: str | os.PathLike[str], kind: str, error: Exception) -> Exception:
    """What to raise for an error while a file was read."""
    if isinstance(error, FileNotFoundError | IsADirectoryError | PermissionError):
        return error
    # On damaged data zipfile, zlib and numpy raise many kinds of errors, with messages such as the
    # advice to allow pickles, which do not help a user.
    reason = f" ({error})" if isinstance(error, InputError) else ""
    return InputError(f"{path}: not {kind}, or a damaged one{reason}")
