"""Seals: SHA-256 of what a file says, kept in the file, by which damage and edits are found.

A seal is of the content, not of the bytes: names, types, shapes and values. It tells accidents and
edits; it is no signature, for everybody can compute it.

Messages and files call it the digest of the content, which people know; in ONNX files it is one of
the bytes, at their end, and is called a stamp (`pianomime.policies.stamp`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

SEAL = "digest"
"""Name of a file's seal among what it holds."""


def seal_of(arrays: Mapping[str, NDArray[Any]], content: Any = None) -> str:
    """The seal of arrays and of anything that JSON can hold, in 64 hexadecimal digits.

    Args:
        arrays: by name; their order does not matter.
        content: what else there is.

    Raises:
        ValueError: JSON cannot hold the content.
    """
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.asarray(arrays[name], order="C")
        digest.update(f"{name!r} {array.dtype.str} {array.shape} ".encode())
        digest.update(array.reshape(-1).view(np.uint8).data)
    return digest.hexdigest()
