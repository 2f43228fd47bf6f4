"""Named arrays and metadata in one sealed safetensors file, from which no code is ever executed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
from numpy.typing import NDArray
from safetensors.numpy import save

from pianomime.errors import InputError
from pianomime.files import atomic
from pianomime.seal import SEAL, seal_of
from pianomime.sealed_json import parse_json

Arrays = dict[str, NDArray[Any]]
"""Arrays by name."""

_METADATA = "about"
"""Key of the metadata in the file's header."""


def write_tensors(path: Path, arrays: Arrays, metadata: dict[str, Any]) -> None:
    """Write a file, whole or not at all.

    Args:
        path: of the file; its folder must exist.
        arrays: by name.
        metadata: anything that JSON can hold.

    Raises:
        OSError: the disk is full, or the folder cannot be written; what was there stays.
    """
    plain = {name: np.asarray(array, order="C") for name, array in arrays.items()}
    text = json.dumps(metadata)
    content = save(plain, {_METADATA: text, SEAL: seal_of(plain, text)})
    with atomic(path) as temporary:
        temporary.write_bytes(content)


def read_tensors(path: Path) -> tuple[Arrays, dict[str, Any]]:
    """The arrays and the metadata that `write_tensors` wrote.

    Raises:
        InputError: there is no such file, it is another or a damaged one, was changed since it was
            written, or holds numbers that are not finite.
    """
    try:
        with safetensors.safe_open(path, framework="numpy") as file:
            header = file.metadata() or {}
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if SEAL not in header:
            raise InputError("it has no digest of its content: make it anew")
        if header[SEAL] != seal_of(arrays, header[_METADATA]):
            raise InputError("it was changed since it was written")
        for name, array in arrays.items():
            if array.dtype.kind == "f" and not np.isfinite(array).all():
                raise InputError(f"{name} holds numbers that are not finite")
        metadata = parse_json(header[_METADATA])
        if not isinstance(metadata, dict):
            raise InputError("its metadata must be an object")
    except FileNotFoundError:
        raise InputError(f"{path}: does not exist") from None
    # A damaged file raises what its reader and its types happen to raise.
    except Exception as error:
        raise InputError(f"{path}: damaged, or not a file of this program ({error})") from error
    return arrays, metadata
