"""Blocks: the parts that a replay consists of (docs/reference/replay-format.md)."""

from __future__ import annotations

import json
import struct
from typing import Any


def block(tag: str, content: bytes) -> bytes:
    """One block of a replay.

    Args:
        tag: 4 ASCII letters that say what the content is.
        content: of the block, shorter than 4 GiB.

    Raises:
        ValueError: the tag has another length.
    """
    letters = tag.encode("ascii")
    if len(letters) != 4:
        raise ValueError(f"a tag has 4 letters, not {len(letters)}: {tag!r}")
    return letters + struct.pack("<I", len(content)) + content


def json_block(tag: str, value: Any) -> bytes:
    """One block whose content is JSON.

    Args:
        tag: as of `block`.
        value: of what JSON can hold.

    Raises:
        ValueError: a number is not finite.
    """
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return block(tag, text.encode())
