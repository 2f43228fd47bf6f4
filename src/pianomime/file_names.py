"""Names of files and folders that are made from titles and from names of other files."""

from __future__ import annotations

import hashlib
import os
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import PurePath

from pianomime.errors import InputError
from pianomime.shown import shown

LONGEST_NAME = 120
"""Bytes of a name at most. File systems allow 255, some of them 143, and callers add a suffix."""

_MOST_BYTES = 255
"""Bytes of the name of a file on any file system that is in use."""
_DIGEST = 8
"""Hexadecimal digits of the digest that tells apart what would have one name."""
# What Windows forbids, and what separates folders anywhere.
_FORBIDDEN = re.compile(r'[<>:"/\\|?*]+')
_DEVICE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)
"""Names of devices on Windows, with any suffix."""
_UNTITLED = "untitled"


def file_name(title: str) -> str:
    """The name for a file or a folder of something with a title, to which a suffix may be added.

    It is one name, never hidden, `.`, `..` or empty, has at most `LONGEST_NAME` bytes and is
    allowed on every system. A title that is such a name is its own; of any other, a digest becomes
    part of the name, so that different titles have different names.

    Args:
        title: any text.
    """
    text = _FORBIDDEN.sub("-", shown(title)).strip(" .")
    # `shown` marks what cannot be seen with backslashes, which have become hyphens.
    name = _shortened(text, LONGEST_NAME)
    if name == title and name and not _DEVICE.fullmatch(name):
        return name
    digest = hashlib.sha256(title.encode("utf-8", "surrogatepass")).hexdigest()[:_DIGEST]
    # The digest goes before a dot that would make it a suffix: `CON.1` is a device as well.
    if _DEVICE.fullmatch(text):
        text = text.replace(".", "-")
    text = _shortened(text.strip("-. ") or _UNTITLED, LONGEST_NAME - _DIGEST - 1)
    return f"{text}-{digest}"


def file_names(paths: Sequence[PurePath]) -> list[str]:
    """Different names for files of different folders: with their folders, and without suffix.

    Files that would have one name, such as `a-b.mid`, `a/b.mid` and `a-b.npz`, get theirs with the
    suffix, and those that still would, with a digest.

    Args:
        paths: of the files, relative to one folder, each once.
    """
    short = [file_name("-".join(path.with_suffix("").parts)) for path in paths]
    count = Counter(short)
    longer = [
        name if count[name] == 1 else file_name("-".join(path.parts))
        for name, path in zip(short, paths, strict=True)
    ]
    count = Counter(longer)
    return [
        name if count[name] == 1 else file_name(f"/{path.as_posix()}")
        for name, path in zip(longer, paths, strict=True)
    ]


def check_name(path: PurePath) -> None:
    """Refuse a name that no file system takes, before the work whose result should bear it.

    Args:
        path: of a file or folder that will be written.

    Raises:
        InputError: its name is too long.
    """
    if len(os.fsencode(path.name)) > _MOST_BYTES:
        raise InputError(f"{path}: the name is longer than {_MOST_BYTES} bytes")


def check_replaceable(path: PurePath) -> None:
    """Refuse a place for a new folder that another path would have to name, such as ".".

    Args:
        path: of a folder that will be replaced as a whole.

    Raises:
        InputError: its last part is no name, or one that is too long.
    """
    if path.name in ("", ".."):
        raise InputError(f"{path}: cannot be replaced as a whole: give the folder a name")
    check_name(path)


def _shortened(text: str, most: int) -> str:
    """The beginning of a text that has at most so many bytes, in whole characters."""
    return text.encode()[:most].decode(errors="ignore").rstrip(" .")
