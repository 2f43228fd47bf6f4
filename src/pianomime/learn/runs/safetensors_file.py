"""Named arrays and metadata in one safetensors file, from which no code is ever executed."""

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
    content = save(plain, {_METADATA: json.dumps(metadata)})
    with atomic(path) as temporary:
        temporary.write_bytes(content)


def read_tensors(path: Path) -> tuple[Arrays, dict[str, Any]]:
    """The arrays and the metadata that `write_tensors` wrote.

    Raises:
        InputError: there is no such file, or it is another or a damaged one.
    """
    try:
        with safetensors.safe_open(path, framework="numpy") as file:
            metadata = json.loads(file.metadata()[_METADATA])
            return {name: file.get_tensor(name) for name in file.keys()}, metadata  # noqa: SIM118
    except FileNotFoundError:
        raise InputError(f"{path}: does not exist") from None
    except (safetensors.SafetensorError, KeyError, TypeError, ValueError, OSError) as error:
        raise InputError(f"{path}: damaged, or not a file of this program ({error})") from error
