"""JSON that is read with care, and objects of JSON that hold their own seal."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from pianomime.errors import InputError
from pianomime.schema import Schema, check_json
from pianomime.seal import SEAL, seal_of

_MOST_BYTES = 64 * 1024**2
"""Bytes of the largest file that is read: what is larger was not written by this program."""


def parse_json(text: str | bytes) -> Any:
    """What a text in JSON says; numbers may be infinite or NaN, which a schema refuses.

    Raises:
        InputError: it is not JSON, is nested too deeply, or an object has a name twice.
    """
    try:
        return json.loads(text, object_pairs_hook=_once)
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError("it is not JSON") from error


def read_json(path: str | os.PathLike[str], most_bytes: int = _MOST_BYTES) -> Any:
    """What a file of JSON says.

    Args:
        path: of the file.
        most_bytes: that it may have.

    Raises:
        OSError: the file does not exist or cannot be read.
        InputError: as `parse_json`, or the file is too large.
    """
    with Path(path).open("rb") as file:
        text = file.read(most_bytes + 1)
    if len(text) > most_bytes:
        raise InputError(f"it is larger than {most_bytes // 1024**2} MiB")
    return parse_json(text)


def sealed(content: dict[str, Any], key: str = "") -> dict[str, Any]:
    """An object with its seal.

    Args:
        content: that JSON can hold.
        key: what the content belongs to: under another one the seal does not hold.
    """
    return {**content, SEAL: seal_of({}, [content, key])}


def unsealed(content: Any, schema: Schema, key: str = "") -> dict[str, Any]:
    """The object that was sealed.

    Args:
        content: what JSON gave.
        schema: of the object, without the seal.
        key: that it was sealed with.

    Raises:
        InputError: it has no seal, or was changed since, or does not fit the schema.
    """
    if not isinstance(content, dict) or SEAL not in content:
        raise InputError("it has no digest of its content")
    plain = {name: value for name, value in content.items() if name != SEAL}
    check_json(plain, schema)
    if content[SEAL] != seal_of({}, [plain, key]):
        raise InputError("it was changed since it was written")
    return plain


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) != len(pairs):
        raise InputError("it holds a name twice")
    return made
