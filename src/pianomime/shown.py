"""Text that others gave, such as names and titles, made fit to be shown and stored."""

from __future__ import annotations

import os
import re
import shlex
import unicodedata
from pathlib import Path

_HIDDEN = ("Cc", "Cf", "Cs", "Zl", "Zp")
"""Categories of what is no letter: control and format characters, halves of characters, breaks."""
_JOINERS = "\u200c\u200d"
"""Format characters of Persian, of Indian scripts and of emoji, which are harmless."""
_BYTE = range(0xDC80, 0xDD00)
"""What stands for the bytes 0x80 to 0xff of a file's name that is not UTF-8."""
_MARKDOWN = re.compile(r"[\\`*\[\]<>|~$&]|\b_|_\b")


def shown(text: object) -> str:
    r"""Text in one line that a terminal shows as letters, and that every file can hold.

    Whatever a terminal would act on, such as escape sequences, ends of lines and changes of the
    direction of writing, becomes a visible escape, such as `\x1b`; so does what is no text in
    UTF-8: the bytes of odd file names. All other text stays as it is.

    Args:
        text: a name, a title, a message; or anything that `str` makes one of, such as a path.
    """
    return "".join(map(_visible, str(text)))


def title_of(path: Path) -> str:
    """The title of a piece, from the name of its file: without the suffix, as `shown`.

    The title of a file without a letter before its suffix, such as `...mid`, is its whole name.

    Args:
        path: of the file.
    """
    return shown(path.stem if path.stem.strip(" .") else path.name)


def markdown_cell(text: object) -> str:
    """Text as `shown`, for a cell of a table in Markdown that shows it letter by letter."""
    return _MARKDOWN.sub(r"\\\g<0>", shown(text))


def command_word(path: str | os.PathLike[str]) -> str:
    """A path as a word of a command to copy: quoted where a shell needs it, in one line."""
    text = os.fspath(path)
    # It would be taken for an option.
    text = f"./{text}" if text.startswith("-") else text
    if shown(text) == text:
        return shlex.quote(text)
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"$'{''.join(map(_visible, escaped))}'"


def _visible(letter: str) -> str:
    if letter.isprintable() or letter in _JOINERS:
        return letter
    if unicodedata.category(letter) not in _HIDDEN:
        return letter
    code = ord(letter)
    if code in _BYTE:
        return f"\\x{code - 0xDC00:02x}"
    if code < 0x100:
        return {"\n": "\\n", "\r": "\\r", "\t": "\\t"}.get(letter, f"\\x{code:02x}")
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
