"""Names that files may have, and titles that they may hold, though nobody would choose them."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from hypothesis import strategies as st

from pianomime import songs

ODD = (
    b"caf\xe9",  # Latin-1
    b"x" * 251,
    b"$\\frac$",
    b"..",
    b"   ",
    b"",
    b".hidden",
    b"Song [piano]",
    b"[bold red]x",
    b"[",
    b":smile:",
    b"\x1b[31mred\x1b]0;owned\x07\x9b1A",
    b"two\nlines\r",
    b'<b>bold & "quoted" ${song}',
    b"CON",
    b"=1+1",
    b"-o",
    b"a|b `c` *d*",
    "\u202egnp.\u2066x".encode(),
    "Für Elise 月光 👩‍🎹".encode(),
)
"""Names without suffix, as bytes; the empty one makes no song, for its suffix is its name."""

texts = st.one_of(
    st.sampled_from([os.fsdecode(name) for name in ODD]),
    st.text(st.characters(codec=None), max_size=300),
    # With dots, spaces and slashes in any place, and bytes that are not UTF-8.
    st.text(st.sampled_from("./\\ -ab:\udce9\x1b\u202e\n"), max_size=12),
    st.binary(max_size=40).map(os.fsdecode),
)
"""Any titles, many of them odd."""


def make_songs(folder: Path, song: str = "twinkle-twinkle") -> list[Path]:
    """Copies of a bundled song under odd names, those that the file system allows."""
    made = []
    for name in filter(None, ODD):
        path = folder / os.fsdecode(name + b".mid")
        try:
            shutil.copyfile(songs.path(song), path)
        except OSError:  # Not all file systems allow all of them.
            continue
        made.append(path)
    return made
